use foxhunt_core::{Axis, MeasurementModel, Observation, Pose, State, log_likelihoods_one_by_one};
use nalgebra::{SMatrix, Vector2};

use super::{RssBearing, Sight, rss_bearing_log_likelihoods};
use crate::{LogDistance, ParameterError, Propagation, parameter};

/// Signal strength and bearing of a transmitter whose power nobody calibrated: the last state
/// component is its P₀ in dBm, z = [P₀ − 10 γ log₁₀ d, atan2(N, E)] with γ known.
///
/// The state is (East, North, …, P₀), N ≥ 3. A transmitter without bearings is the same with
/// the bearing missing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreePowerRssBearing {
    /// The law with P₀ = 0.
    loss: LogDistance,
    target_up: f64,
}

impl FreePowerRssBearing {
    /// The model for a target on the ground, Up = 0, and the path-loss exponent γ.
    ///
    /// # Errors
    ///
    /// When the exponent is not a positive number.
    pub fn new(exponent: f64) -> Result<Self, ParameterError> {
        Ok(Self { loss: LogDistance::new(0.0, exponent)?, target_up: 0.0 })
    }

    /// The same for a target at another height, in metres.
    ///
    /// # Errors
    ///
    /// When the height is not finite.
    pub fn with_target_up(self, target_up: f64) -> Result<Self, ParameterError> {
        Ok(Self { target_up: parameter::finite("target_up", target_up)?, ..self })
    }
}

/// The same law with its reference power forgotten.
impl From<RssBearing<LogDistance>> for FreePowerRssBearing {
    fn from(known: RssBearing<LogDistance>) -> Self {
        let loss = known.propagation().without_reference();
        Self { loss, target_up: known.target_up() }
    }
}

impl<const N: usize> MeasurementModel<N, 2> for FreePowerRssBearing {
    fn axes(&self) -> [Axis; 2] {
        [Axis::Linear, Axis::Angle]
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> Vector2<f64> {
        const { assert!(N >= 3, "a state holds East, North and the reference power") };
        let sight = Sight::new(state, receiver, self.target_up);
        Vector2::new(state[N - 1] + self.loss.rss_dbm(sight.range()), sight.bearing())
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, 2, N> {
        let sight = Sight::new(state, receiver, self.target_up);
        let mut jacobian = SMatrix::<f64, 2, N>::zeros();
        [jacobian[(0, 0)], jacobian[(0, 1)]] = sight.power_slope(&self.loss);
        jacobian[(0, N - 1)] = 1.0;
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
            |i, range| columns[N - 1][i] + self.loss.rss_dbm(range),
            out,
        );
    }
}
