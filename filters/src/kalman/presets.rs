use foxhunt_core::{Estimate, EstimatorError, MeasurementModel, RandomWalk};

use super::{
    filter::{Ekf, Kalman, Ukf},
    gate::Gate,
};
use crate::Unscented;

/// The root of the process noise per step, in metres (Pritzl 2018, §4.4).
const DRIFT: f64 = 0.1957;

impl<H: MeasurementModel<2, M>, const M: usize> Ukf<RandomWalk<2>, H, 2, M> {
    /// The reference's filter (Pritzl 2018, §4.4): α = 0.001, β = 2, κ = 3 − n; a still target
    /// with the process noise q = 0.1957 m per step; [`Gate::pritzl2018`].
    ///
    /// Its time counts steps: `predict(1.0)` before every update that is executed, the first
    /// included. It starts from P = 70 m² I about the centroid of the drones.
    ///
    /// The document prints q² as "0.19572", which is 0.1957² without its exponent, or a variance
    /// of 0.19572 m². This is the first reading; for the second, add
    /// `.with_motion(RandomWalk::uniform(0.19572_f64.sqrt()))`.
    ///
    /// # Errors
    ///
    /// When the prior is not finite or its covariance not symmetric and positive definite.
    pub fn pritzl2018(measurement: H, prior: Estimate<2>) -> Result<Self, EstimatorError> {
        let open: Self = Kalman::new(RandomWalk::uniform(DRIFT), measurement, prior)?;
        Ok(open.with_transform(Unscented::pritzl2018())?.with_gate(Gate::pritzl2018()))
    }
}

impl<H: MeasurementModel<2, M>, const M: usize> Ekf<RandomWalk<2>, H, 2, M> {
    /// The reference's alternative (Pritzl 2018, §4.4): as `Ukf::pritzl2018`, linearised.
    ///
    /// # Errors
    ///
    /// When the prior is not finite or its covariance not symmetric and positive definite.
    pub fn pritzl2018(measurement: H, prior: Estimate<2>) -> Result<Self, EstimatorError> {
        let open: Self = Kalman::new(RandomWalk::uniform(DRIFT), measurement, prior)?;
        Ok(open.with_gate(Gate::pritzl2018()))
    }
}
