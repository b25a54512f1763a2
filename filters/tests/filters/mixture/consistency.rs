use foxhunt_core::{
    Estimate, Estimator, MeasurementModel, Pose, RandomWalk,
    nalgebra::{Matrix2, Vector2},
};
use foxhunt_filters::{Ekf, GaussianSum, split};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::model::{Bearing, bearing, mean_and_error, rng, white};

const RUNS: u32 = 300;

/// The NEES after eight bearings of 0.05 rad from a circle about the prior's mean, truth drawn
/// from the prior; run i from seed i.
fn nees(prior: &Estimate<2>, radius: f64, make: impl Fn() -> Box<dyn Estimator<2, 1>>) -> Vec<f64> {
    let run = |seed: u32| {
        let mut rng = rng(u64::from(seed));
        let root = prior.covariance.cholesky().expect("proper").unpack();
        let truth = prior.mean + root * white::<2>(&mut rng);
        let mut filter = make();
        for step in 0..8 {
            let (sin, cos) = libm::sincos(1.9 * f64::from(step));
            let receiver = prior.mean + Vector2::new(cos, sin) * radius;
            let pose = Pose::at(receiver.x, receiver.y, 0.0);
            let value = Bearing.expected(&truth, &pose)[0] + 0.05 * white::<1>(&mut rng)[0];
            filter.predict(1.0).expect("a proper step");
            let _ = filter.update(&bearing(receiver, value, 0.05)).expect("proper");
        }
        filter.estimate().nees(&truth).expect("positive definite")
    };
    (0..RUNS).map(run).collect()
}

#[test]
fn a_sum_is_consistent_where_one_gaussian_is_too_sure() {
    let still = RandomWalk::uniform(0.0);
    // Far off the mean and nearly linear: the band that the sum of χ² variables leaves with 5 %.
    let tilted = Matrix2::new(9.0, 3.0, 3.0, 4.0);
    let mild = Estimate { mean: Vector2::new(5.0, 8.0), covariance: tilted };
    let sum = |prior: Estimate<2>, parts| {
        let one = Ekf::new(still, Bearing, prior).expect("proper");
        GaussianSum::new(&one, split(&prior, parts).expect("proper")).expect("proper")
    };
    let reported = nees(&mild, 60.0, || Box::new(sum(mild, [3, 3])));
    let chi = ChiSquared::new(2.0 * f64::from(RUNS)).expect("positive");
    let [low, high] = [0.025, 0.975].map(|p| chi.inverse_cdf(p) / f64::from(RUNS));
    let (mean, _) = mean_and_error(&reported);
    assert!((low..high).contains(&mean), "ANEES {mean:.3}, not in {low:.3}..{high:.3}");

    // Through the middle of it: E[NEES] = 2 for the exact posterior whatever its shape; 3.3
    // standard errors for a false alarm in 1000, and a tenth for what is not exact.
    let wild = Estimate { mean: Vector2::new(5.0, 8.0), covariance: tilted * 16.0 };
    let reported = nees(&wild, 10.0, || Box::new(sum(wild, [15, 15])));
    let (mean, error) = mean_and_error(&reported);
    assert!((mean - 2.0).abs() < 0.2 + 3.3 * error, "ANEES {mean:.3} ± {error:.3}");
    let split =
        || sum(wild, [5, 5]).with_most_components(30).and_then(|s| s.with_resplitting(0.1, 3));
    let (mean, error) = mean_and_error(&nees(&wild, 10.0, || Box::new(split().expect("in range"))));
    assert!((mean - 2.0).abs() < 0.2 + 3.3 * error, "resplit: ANEES {mean:.3} ± {error:.3}");
    let one = nees(&wild, 10.0, || Box::new(Ekf::new(still, Bearing, wild).expect("proper")));
    assert!(mean_and_error(&one).0 > 5.0, "too easy a problem");
}
