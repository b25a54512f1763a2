use foxhunt_core::{
    ConstantVelocity, CoordinatedTurn, Estimate, MotionModel, RandomWalk, State, laws,
    nalgebra::{Matrix2, Vector2, Vector4},
};
use foxhunt_filters::{Bank, Ckf, Ekf, Gate, GaussianSum, Imm, Iterations, Transition, Ukf, split};
use proptest::prelude::*;

use super::model::{Bearing, bearing};

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
        laws::estimator(sum, &observed);
        laws::estimator(|| sum().with_resplitting(0.3, 3).expect("in range"), &observed);
        laws::estimator(|| sum().with_most_components(5).expect("in range"), &observed);
        let five = Iterations::at_most(5).expect("in range");
        let ckf = Ckf::new(still, Bearing, prior).expect("a proper prior").with_iterations(five);
        laws::estimator(|| GaussianSum::new(&ckf, parts.clone()).expect("proper"), &observed);
        let gated = ekf.clone().with_gate(Gate::probability(0.9).expect("in range"));
        laws::estimator(|| GaussianSum::new(&gated, parts.clone()).expect("proper"), &observed);
        let bank = || Bank::new([(0.3, ekf.clone()), (0.7, gated.clone())]).expect("proper");
        laws::estimator(bank, &observed);

        let mut moving = Estimate::isotropic(Vector4::new(east, north, 1.0, -1.0), sigma);
        moving.covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&covariance);
        let still = RandomWalk { drift: Vector4::new(0.1, 0.1, 0.01, 0.01) };
        let straight = ConstantVelocity { acceleration_density: 0.2 };
        let models: [&dyn MotionModel<4>; 2] = [&still, &straight];
        let imm = || {
            let ukf = |motion| Ukf::new(motion, Bearing, moving).expect("a proper prior");
            let chain = Transition::sojourn(&[30.0, 10.0]).expect("positive");
            Imm::new(models.map(|m| (0.5, ukf(m))), chain).expect("proper")
        };
        laws::estimator(imm, &observed);
        laws::estimator(|| imm().with_innovation(Ukf::innovation), &observed);
    }

    #[test]
    fn every_motion_keeps_its_laws(
        place in prop::array::uniform2(-50.0..50.0), velocity in prop::array::uniform2(-9.0..9.0),
        rate in -2.0..2.0, scale in 0.0..1.0, dt in 0.0..10.0,
    ) {
        let turn = CoordinatedTurn { acceleration_density: 0.3, turn_rate_drift: 0.05 };
        // Rates near 0, too, where the closed form has no digits.
        let rate = rate * f64::powi(scale, 8);
        let state = State::from([place[0], place[1], velocity[0], velocity[1], rate]);
        laws::motion_model(&turn, &state, dt);
        let walk = RandomWalk { drift: State::from([0.1, 0.2, 0.3, 0.4, 0.05]) };
        laws::motion_model(&walk, &state, dt);
        let straight = ConstantVelocity { acceleration_density: 0.3 };
        laws::motion_model(&straight, &state.fixed_rows::<4>(0).into_owned(), dt);
    }
}
