use foxhunt_core::{Axis, MeasurementModel, Observation, Pose, State, log_likelihoods_one_by_one};
use nalgebra::{SMatrix, Vector2};

use super::{Sight, rss_bearing_log_likelihoods};
use crate::{ParameterError, Propagation, parameter};

/// Signal strength and bearing, z = [P(d) in dBm, atan2(N, E) in radians] (Pritzl 2018, eq. 3.7).
///
/// d is the slant range; the bearing is the direction from the receiver to the target in the
/// world frame. Exactly over the target the bearing is 0 with a zero Jacobian: it says nothing.
/// Works on every state whose first components are the target's East and North.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RssBearing<P> {
    propagation: P,
    target_up: f64,
}

impl<P: Propagation> RssBearing<P> {
    /// The model for a target on the ground, Up = 0.
    #[must_use]
    pub fn new(propagation: P) -> Self {
        Self { propagation, target_up: 0.0 }
    }

    /// The same for a target at another height, in metres.
    ///
    /// # Errors
    ///
    /// When the height is not finite.
    pub fn with_target_up(self, target_up: f64) -> Result<Self, ParameterError> {
        Ok(Self { target_up: parameter::finite("target_up", target_up)?, ..self })
    }

    /// How power falls with range.
    #[must_use]
    pub fn propagation(&self) -> &P {
        &self.propagation
    }

    /// How high above the ground the target is taken to be, in metres.
    #[must_use]
    pub fn target_up(&self) -> f64 {
        self.target_up
    }
}

impl<P: Propagation, const N: usize> MeasurementModel<N, 2> for RssBearing<P> {
    fn axes(&self) -> [Axis; 2] {
        [Axis::Linear, Axis::Angle]
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> Vector2<f64> {
        let sight = Sight::new(state, receiver, self.target_up);
        Vector2::new(self.propagation.rss_dbm(sight.range()), sight.bearing())
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, 2, N> {
        let sight = Sight::new(state, receiver, self.target_up);
        let mut jacobian = SMatrix::<f64, 2, N>::zeros();
        [jacobian[(0, 0)], jacobian[(0, 1)]] = sight.power_slope(&self.propagation);
        [jacobian[(1, 0)], jacobian[(1, 1)]] = sight.bearing_slope();
        jacobian
    }

    fn log_likelihoods(&self, columns: [&[f64]; N], observation: &Observation<2>, out: &mut [f64]) {
        if !observation.is_plain() {
            return log_likelihoods_one_by_one(self, columns, observation, out);
        }
        rss_bearing_log_likelihoods(
            [columns[0], columns[1]],
            self.target_up,
            observation,
            |_, range| self.propagation.rss_dbm(range),
            out,
        );
    }
}
