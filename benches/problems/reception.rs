//! A search, and what its drones receive.

use foxhunt::{
    config::{BoxedEstimator, ModelConfig},
    prelude::*,
};
use nalgebra::{Matrix2, Vector2};

/// An estimator by its name that has taken in 12 receptions, one every 30 s.
pub(crate) fn in_the_middle(estimator: &EstimatorEntry) -> Option<BoxedEstimator<2, 2>> {
    let model = ModelConfig {
        reference_dbm: -29.06,
        exponent: 2.765,
        target_up_m: 0.0,
        antenna: None,
        reference_m: None,
        pulses: None,
        terrain: None,
    };
    let model = model.build().expect("in range");
    let prior = Estimate::isotropic(Vector2::new(3.0, -2.0), 50.0);
    let mut estimator = estimator.settings()?.build(model, &prior, 1).expect("a proper prior");
    for turn in 0..12 {
        receive(&mut estimator, &observation(turn));
    }
    Some(estimator)
}

/// One prediction and one update.
pub(crate) fn receive(estimator: &mut BoxedEstimator<2, 2>, observation: &Observation<2>) {
    estimator.predict(30.0).expect("a proper step");
    let _ = estimator.update(observation).expect("possible");
}

/// The observation of a drone on its place of a triangle about the beacon.
pub(crate) fn observation(turn: u32) -> Observation<2> {
    let around = 2.1 * f64::from(turn);
    let receiver = Pose::at(6.0 * around.cos(), 6.0 * around.sin(), 4.0);
    let value = Vector2::new(-53.0 + 3.0 * (3.0 * around).sin(), around + 3.3);
    let noise = Matrix2::from_diagonal(&Vector2::new(62.0, 0.27));
    Observation::new(30.0 * f64::from(turn), receiver, value, noise).expect("plain numbers")
}
