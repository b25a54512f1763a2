use foxhunt_core::{Estimate, Estimator, Pose, RandomWalk, nalgebra::Vector2};
use foxhunt_filters::{Ckf, Ekf, Iterations, ParticleFilter, Ukf, Unscented};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

use super::model::{FIELD, observed};

/// Runs of 30 observations that no flight would bring; seed `i` for run `i`.
fn survives<E: Estimator<2, 2>>(
    name: &str,
    runs: u64,
    make: impl Fn(RandomWalk<2>, Estimate<2>, u64) -> E,
) {
    for run in 0..runs {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(run);
        // From centimetres to kilometres.
        let mut size = |low: f64, high: f64| 10.0_f64.powf(rng.random_range(low..high));
        let sigma = size(-2.0, 3.0);
        let far = size(-1.0, 3.7);
        let drift = size(-3.0, 1.0);
        let scale = [size(-1.0, 3.0), size(-3.0, 1.0)];
        let start = Vector2::new(far, -0.3 * far);
        let mut filter = make(RandomWalk::uniform(drift), Estimate::isotropic(start, sigma), run);
        for step in 0..30 {
            filter.predict(1.0).unwrap_or_else(|e| panic!("{name}, run {run}, step {step}: {e}"));
            let believed = filter.estimate().mean;
            let receiver = match rng.random_range(0..5_u8) {
                // On the belief, on the ground and above it; on the prior; beside it; far off.
                0 => Pose::at(believed.x, believed.y, 0.0),
                1 => Pose::at(believed.x, believed.y, 4.0),
                2 => Pose::at(start.x, start.y, 4.0),
                3 => Pose::at(believed.x + 1e-9, believed.y, 1.0),
                _ => Pose::at(rng.random_range(-1e4..1e4), rng.random_range(-1e4..1e4), 30.0),
            };
            let pi = std::f64::consts::PI;
            let bearing = match rng.random_range(0..4_u8) {
                0 => pi,
                1 => -pi,
                2 => pi - 1e-12,
                _ => rng.random_range(-pi..pi),
            };
            let z = Vector2::new(rng.random_range(-140.0..20.0), bearing);
            let whole = observed(receiver, z, scale[0], scale[1]);
            let observed = match rng.random_range(0..4_u8) {
                0 => whole.without(0),
                1 => whole.without(1),
                _ => whole,
            };
            let reported = filter.update(&observed);
            assert!(reported.is_ok(), "{name}, run {run}, step {step}: {reported:?}");
            let Estimate { mean, covariance } = filter.estimate();
            assert!(mean.iter().all(|m| m.is_finite()), "{name}, run {run}, step {step}: {mean}");
            assert!(
                covariance.cholesky().is_some(),
                "{name}, run {run}, step {step}: {covariance}"
            );
            assert!((covariance - covariance.transpose()).norm() <= 0.0);
        }
    }
}

const PROPER: &str = "a proper prior";

#[test]
fn nothing_makes_a_gaussian_indefinite() {
    survives("EKF", 500, |f, prior, _| Ekf::new(f, FIELD, prior).expect(PROPER));
    survives("UKF", 500, |f, prior, _| Ukf::new(f, FIELD, prior).expect(PROPER));
    let ten = Iterations::at_most(10).expect("at least one");
    survives("iterated EKF", 500, |f, prior, _| {
        Ekf::new(f, FIELD, prior).expect(PROPER).with_iterations(ten)
    });
    survives("iterated CKF", 500, |f, prior, _| {
        Ckf::new(f, FIELD, prior).expect(PROPER).with_iterations(ten)
    });
    survives("UKF of the reference", 500, |f, prior, _| {
        Ukf::pritzl2018(FIELD, prior).expect(PROPER).with_motion(f)
    });
    survives("UKF without its gate", 500, |f, prior, _| {
        let thin = Unscented::pritzl2018();
        Ukf::new(f, FIELD, prior).and_then(|ukf| ukf.with_transform(thin)).expect(PROPER)
    });
}

#[test]
fn nothing_makes_a_cloud_indefinite() {
    survives("particles", 200, |f, prior, seed| {
        let rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        ParticleFilter::new(f, FIELD, prior, 200, rng).expect(PROPER)
    });
}
