//! Laws and statistics of mixtures.

use approx::abs_diff_eq;
use foxhunt_core::{
    ConstantVelocity, CoordinatedTurn, Estimate, Estimator, MeasurementModel, MotionModel, Pose,
    RandomWalk, State,
    laws::{self, Checks},
    nalgebra::{Matrix2, Vector2, Vector4},
};
use foxhunt_filters::{Bank, Ckf, Ekf, Gate, GaussianSum, Imm, Iterations, Transition, Ukf, split};
use proptest::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::model::{Bearing, bearing, mean_and_error, rng, white};

const RUNS: u32 = 300;

/// The laws at one observation: these problems are as coarse as they come.
const AT_ONE: Checks = Checks::AT_ONE_OBSERVATION;

proptest! {
    #[test]
    fn every_mixture_keeps_the_laws(
        east in -200.0..200.0, north in -200.0..200.0, sigma in 1.0..50.0, tilt in -0.9..0.9,
        value in -4.0..4.0, sigma_bearing in 0.02..2.0,
    ) {
        let covariance = Matrix2::new(1.0, tilt, tilt, 1.0) * (sigma * sigma);
        let prior = Estimate { mean: Vector2::new(east, north), covariance };
        let observed = bearing(Vector2::new(12.0, -5.0), value, sigma_bearing);
        let still = RandomWalk::uniform(0.2);

        let ekf = Ekf::new(still, Bearing, prior).expect("a proper prior");
        let parts = split(&prior, [4, 3]).expect("a proper prior");
        let sum = || GaussianSum::new(&ekf, parts.clone()).expect("proper");
        laws::estimator_with(sum, &observed, AT_ONE);
        let resplit = || sum().with_resplitting(0.3, 3).expect("in range");
        laws::estimator_with(resplit, &observed, AT_ONE);
        let merged = || sum().with_most_components(5).expect("in range");
        laws::estimator_with(merged, &observed, AT_ONE);
        let five = Iterations::at_most(5).expect("in range");
        let ckf = Ckf::new(still, Bearing, prior).expect("a proper prior").with_iterations(five);
        let of_ckf = || GaussianSum::new(&ckf, parts.clone()).expect("proper");
        laws::estimator_with(of_ckf, &observed, AT_ONE);
        let gated = ekf.clone().with_gate(Gate::probability(0.9).expect("in range"));
        let of_gated = || GaussianSum::new(&gated, parts.clone()).expect("proper");
        laws::estimator_with(of_gated, &observed, AT_ONE);
        let bank = || Bank::new([(0.3, ekf.clone()), (0.7, gated.clone())]).expect("proper");
        laws::estimator_with(bank, &observed, AT_ONE);

        let mut moving = Estimate::isotropic(Vector4::new(east, north, 1.0, -1.0), sigma);
        moving.covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&covariance);
        let still = RandomWalk { drift: Vector4::new(0.1, 0.1, 0.01, 0.01) };
        let straight = ConstantVelocity { spectral_density: 0.04 };
        let models: [&dyn MotionModel<4>; 2] = [&still, &straight];
        let imm = || {
            let ukf = |motion| Ukf::new(motion, Bearing, moving).expect("a proper prior");
            let chain = Transition::sojourn(&[30.0, 10.0]).expect("positive");
            Imm::new(models.map(|m| (0.5, ukf(m))), chain).expect("proper")
        };
        laws::estimator_with(imm, &observed, AT_ONE);
        laws::estimator_with(|| imm().with_innovation(Ukf::innovation), &observed, AT_ONE);
    }

    #[test]
    fn every_motion_keeps_its_laws(
        place in prop::array::uniform2(-50.0..50.0), velocity in prop::array::uniform2(-9.0..9.0),
        rate in -2.0..2.0, scale in 0.0..1.0, dt in 0.0..10.0,
    ) {
        let turn = CoordinatedTurn { spectral_density: 0.09, turn_rate_drift: 0.05 };
        // Rates near 0, too, where the closed form has no digits.
        let rate = rate * f64::powi(scale, 8);
        let state = State::from([place[0], place[1], velocity[0], velocity[1], rate]);
        laws::motion_model(&turn, &state, dt);
        let walk = RandomWalk { drift: State::from([0.1, 0.2, 0.3, 0.4, 0.05]) };
        laws::motion_model(&walk, &state, dt);
        let straight = ConstantVelocity { spectral_density: 0.09 };
        laws::motion_model(&straight, &state.fixed_rows::<4>(0).into_owned(), dt);
    }
}

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
    assert!(abs_diff_eq!(mean, 2.0, epsilon = 0.2 + 3.3 * error), "ANEES {mean:.3} ± {error:.3}");
    let split =
        || sum(wild, [5, 5]).with_most_components(30).and_then(|s| s.with_resplitting(0.1, 3));
    let (mean, error) = mean_and_error(&nees(&wild, 10.0, || Box::new(split().expect("in range"))));
    assert!((mean - 2.0).abs() < 0.2 + 3.3 * error, "resplit: ANEES {mean:.3} ± {error:.3}");
    let one = nees(&wild, 10.0, || Box::new(Ekf::new(still, Bearing, wild).expect("proper")));
    assert!(mean_and_error(&one).0 > 5.0, "too easy a problem");
}
