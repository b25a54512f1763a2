use foxhunt_core::{Axis, MeasurementModel, Observation, Pose, State, log_likelihoods_one_by_one};
use nalgebra::{SMatrix, Vector2};

use super::{Sight, rss_bearing_log_likelihoods};
use crate::{LogDistance, ParameterError, Propagation, parameter};

/// Signal strength and bearing where neither power nor exponent is known: the last two state
/// components are P₀ in dBm and γ, z = [P₀ − 10 γ log₁₀ d, atan2(N, E)].
///
/// The state is (East, North, …, P₀, γ), N ≥ 4. Power and exponent can only be told apart from
/// several ranges: give both a prior that means something.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreePathLossRssBearing {
    /// The law with P₀ = 0 and γ = 1: the loss of one exponent.
    unit: LogDistance,
    target_up: f64,
}

impl FreePathLossRssBearing {
    /// The model for a target on the ground, Up = 0.
    #[must_use]
    pub fn new() -> Self {
        Self { unit: LogDistance::UNIT, target_up: 0.0 }
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

/// The same as [`new`](Self::new).
impl Default for FreePathLossRssBearing {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> MeasurementModel<N, 2> for FreePathLossRssBearing {
    fn axes(&self) -> [Axis; 2] {
        [Axis::Linear, Axis::Angle]
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> Vector2<f64> {
        const { assert!(N >= 4, "a state holds East, North, reference power and exponent") };
        let sight = Sight::new(state, receiver, self.target_up);
        let rss = state[N - 2] + state[N - 1] * self.unit.rss_dbm(sight.range());
        Vector2::new(rss, sight.bearing())
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, 2, N> {
        let sight = Sight::new(state, receiver, self.target_up);
        let [east, north] = sight.power_slope(&self.unit);
        let mut jacobian = SMatrix::<f64, 2, N>::zeros();
        jacobian[(0, 0)] = state[N - 1] * east;
        jacobian[(0, 1)] = state[N - 1] * north;
        jacobian[(0, N - 2)] = 1.0;
        jacobian[(0, N - 1)] = self.unit.rss_dbm(sight.range());
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
            |i, range| columns[N - 2][i] + columns[N - 1][i] * self.unit.rss_dbm(range),
            out,
        );
    }
}
