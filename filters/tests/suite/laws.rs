use foxhunt_core::{
    Estimate, Estimator, Observation, Pose, RandomWalk, laws,
    nalgebra::{Matrix2, Vector2},
};
use foxhunt_filters::{
    Ckf, Ekf, Gate, Iterations, KldSampling, ParticleFilter, Resampling, Ukf, Unscented,
};
use proptest::prelude::*;
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

use crate::model::{FIELD, heard};

const STILL: f64 = 0.1957;

fn particles(prior: Estimate<2>, scheme: Resampling, bandwidth: f64) -> impl Estimator<2, 2> {
    let rng = Xoshiro256PlusPlus::seed_from_u64(1);
    ParticleFilter::new(RandomWalk::uniform(STILL), FIELD, prior, 300, rng)
        .and_then(|filter| filter.with_kernel_bandwidth(bandwidth))
        .expect("a proper prior")
        .with_resampling(scheme)
}

fn adaptive(prior: Estimate<2>) -> impl Estimator<2, 2> {
    let rng = Xoshiro256PlusPlus::seed_from_u64(1);
    let size = KldSampling::new(Vector2::repeat(5.0), 200, 400).expect("in range");
    ParticleFilter::new(RandomWalk::uniform(STILL), FIELD, prior, 300, rng)
        .and_then(|filter| filter.with_progressive_correction(0.5))
        .and_then(|filter| filter.with_resampling_threshold(1.0))
        .expect("a proper prior")
        .with_adaptive_size(size)
}

/// A prior anywhere and what a drone near by may hear.
pub(crate) fn problem() -> impl Strategy<Value = (Estimate<2>, Observation<2>)> {
    let prior = (-200.0..200.0, -200.0..200.0, 1.0..50.0, -0.9..0.9).prop_map(
        |(east, north, sigma, tilt): (f64, f64, f64, f64)| {
            let covariance = Matrix2::new(1.0, tilt, tilt, 1.0) * (sigma * sigma);
            Estimate { mean: Vector2::new(east, north), covariance }
        },
    );
    let observation = (0.0..60.0, -110.0..-20.0, -4.0..4.0, 0.5..20.0, 0.02..2.0).prop_map(
        |(up, rss, bearing, sigma_rss, sigma_bearing)| {
            let receiver = Pose::at(12.0, -5.0, up);
            heard(receiver, Vector2::new(rss, bearing), sigma_rss, sigma_bearing)
        },
    );
    (prior, observation)
}

proptest! {
    #[test]
    fn every_estimator_keeps_the_laws((prior, heard) in problem()) {
        let still = RandomWalk::uniform(STILL);

        let ekf = || Ekf::new(still, FIELD, prior).expect("a proper prior");
        laws::estimator(ekf, &heard);
        laws::estimator(|| ekf().with_gate(Gate::probability(0.99).expect("in range")), &heard);
        laws::estimator(|| Ukf::new(still, FIELD, prior).expect("a proper prior"), &heard);
        let thin = Unscented::new(0.01, 2.0, 0.0).expect("in range");
        let ukf = || Ukf::new(still, FIELD, prior).and_then(|ukf| ukf.with_transform(thin));
        laws::estimator(|| ukf().expect("a proper prior"), &heard);
        let ckf = || Ckf::new(still, FIELD, prior).expect("a proper prior");
        laws::estimator(ckf, &heard);
        let five = Iterations::at_most(5).expect("at least one");
        laws::estimator(|| ckf().with_iterations(five), &heard);
        laws::estimator(|| ekf().with_iterations(five), &heard);
        laws::estimator(|| Ukf::pritzl2018(FIELD, prior).expect("a proper prior"), &heard);
        laws::estimator(|| Ekf::pritzl2018(FIELD, prior).expect("a proper prior"), &heard);
        laws::estimator(|| particles(prior, Resampling::Systematic, 0.3), &heard);
        laws::estimator(|| particles(prior, Resampling::Multinomial, 0.0), &heard);
        laws::estimator(|| particles(prior, Resampling::Stratified, 0.2), &heard);
        laws::estimator(|| particles(prior, Resampling::Residual, 0.2), &heard);
        laws::estimator(|| adaptive(prior), &heard);
        let boxed = || -> Box<dyn Estimator<2, 2>> {
            Box::new(particles(prior, Resampling::Systematic, 0.1))
        };
        laws::estimator(boxed, &heard);
    }
}
