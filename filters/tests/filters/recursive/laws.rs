use foxhunt_core::{
    Estimate, Estimator, MeasurementModel, Observation, OutlierMixture, Pose, Quantity, RandomWalk,
    State,
    laws::{self, Checks},
    nalgebra::{Matrix2, Vector2},
};
use foxhunt_filters::{
    Ckf, Ekf, Gate, GaussianSum, GridConfig, GridFilter, Iterations, KldSampling, ParticleFilter,
    Resampling, Ukf, Unscented, split,
};
use proptest::prelude::*;
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

use super::model::{FIELD, observed};

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

/// A prior anywhere and what a drone near by may observe.
pub(super) fn problem() -> impl Strategy<Value = (Estimate<2>, Observation<2>)> {
    let prior = (-200.0..200.0, -200.0..200.0, 1.0..50.0, -0.9..0.9).prop_map(
        |(east, north, sigma, tilt): (f64, f64, f64, f64)| {
            let covariance = Matrix2::new(1.0, tilt, tilt, 1.0) * (sigma * sigma);
            Estimate { mean: Vector2::new(east, north), covariance }
        },
    );
    let observation = (0.0..60.0, -110.0..-20.0, -4.0..4.0, 0.5..20.0, 0.02..2.0).prop_map(
        |(up, rss, bearing, sigma_rss, sigma_bearing)| {
            let receiver = Pose::at(12.0, -5.0, up);
            observed(receiver, Vector2::new(rss, bearing), sigma_rss, sigma_bearing)
        },
    );
    (prior, observation)
}

/// A level of any value within 100 dB and a bearing from anywhere, one in five.
fn outliers() -> OutlierMixture<2> {
    OutlierMixture::new(0.2, [100.0, core::f64::consts::TAU]).expect("in range")
}

/// [`FIELD`] with outliers.
#[derive(Clone, Copy)]
struct Doubtful;

impl MeasurementModel<2, 2> for Doubtful {
    fn quantities(&self) -> [Quantity; 2] {
        FIELD.quantities()
    }

    fn expected(&self, state: &State<2>, receiver: &Pose) -> Vector2<f64> {
        FIELD.expected(state, receiver)
    }

    fn log_likelihood(&self, state: &State<2>, observation: &Observation<2>) -> f64 {
        outliers().log_density(FIELD.log_likelihood(state, observation), observation)
    }
}

#[test]
#[should_panic(expected = "Kalman<foxhunt_filters::transform::taylor::Taylor")]
fn a_breach_names_the_estimator() {
    let prior = Estimate::isotropic(Vector2::new(6.0, -3.0), 2.0);
    let observed = observed(Pose::at(40.0, 0.0, 4.0), Vector2::new(-60.0, 1.0), 4.0, 0.1);
    // By the default checks a model of outliers is in breach.
    let ekf = Ekf::new(RandomWalk::uniform(STILL), FIELD, prior).expect("a proper prior");
    laws::estimator(|| ekf.clone().with_outliers(outliers()), &observed);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn every_estimator_over_outliers_keeps_the_laws((prior, observed) in problem()) {
        let checks = Checks { worthless_tolerance: None, ..Checks::default() };
        let still = RandomWalk::uniform(STILL);
        let ekf = Ekf::new(still, FIELD, prior).expect("a proper prior");
        laws::estimator_with(|| ekf.clone().with_outliers(outliers()), &observed, checks);
        let ckf = Ckf::new(still, FIELD, prior).expect("a proper prior");
        laws::estimator_with(|| ckf.clone().with_outliers(outliers()), &observed, checks);
        let parts = split(&prior, [3, 2]).expect("a proper prior");
        let sum = || GaussianSum::new(&ekf, parts.clone()).expect("proper");
        laws::estimator_with(|| sum().with_outliers(outliers()), &observed, checks);
        let cloud = || {
            let rng = Xoshiro256PlusPlus::seed_from_u64(1);
            ParticleFilter::new(still, Doubtful, prior, 300, rng).expect("a proper prior")
        };
        laws::estimator_with(cloud, &observed, checks);
        let config = GridConfig { side: 32, ..GridConfig::default() };
        let grid = || GridFilter::new(still, Doubtful, prior, config.clone()).expect("proper");
        laws::estimator_with(grid, &observed, checks);
        laws::measurement_model(&Doubtful, &prior.mean, &observed);
    }
}

proptest! {
    #[test]
    fn every_estimator_keeps_the_laws((prior, observed) in problem()) {
        let still = RandomWalk::uniform(STILL);

        let ekf = || Ekf::new(still, FIELD, prior).expect("a proper prior");
        laws::estimator(ekf, &observed);
        laws::estimator(|| ekf().with_gate(Gate::probability(0.99).expect("in range")), &observed);
        laws::estimator(|| Ukf::new(still, FIELD, prior).expect("a proper prior"), &observed);
        let thin = Unscented::new(0.01, 2.0, 0.0).expect("in range");
        let ukf = || Ukf::new(still, FIELD, prior).and_then(|ukf| ukf.with_transform(thin));
        laws::estimator(|| ukf().expect("a proper prior"), &observed);
        let ckf = || Ckf::new(still, FIELD, prior).expect("a proper prior");
        laws::estimator(ckf, &observed);
        let five = Iterations::at_most(5).expect("at least one");
        laws::estimator(|| ckf().with_iterations(five), &observed);
        laws::estimator(|| ekf().with_iterations(five), &observed);
        laws::estimator(|| Ukf::pritzl2018(FIELD, prior).expect("a proper prior"), &observed);
        laws::estimator(|| Ekf::pritzl2018(FIELD, prior).expect("a proper prior"), &observed);
        laws::estimator(|| particles(prior, Resampling::Systematic, 0.3), &observed);
        laws::estimator(|| particles(prior, Resampling::Multinomial, 0.0), &observed);
        laws::estimator(|| particles(prior, Resampling::Stratified, 0.2), &observed);
        laws::estimator(|| particles(prior, Resampling::Residual, 0.2), &observed);
        laws::estimator(|| adaptive(prior), &observed);
        let boxed = || -> Box<dyn Estimator<2, 2>> {
            Box::new(particles(prior, Resampling::Systematic, 0.1))
        };
        laws::estimator(boxed, &observed);
    }
}
