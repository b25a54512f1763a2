use foxhunt_core::{
    MeasurementModel, Pose, Quantity, State,
    parameter::{self, ParameterError},
    vectorised::run,
};
use nalgebra::{SMatrix, Vector1};

use super::{Sight, columns::LevelResiduals, sight::differences};
use crate::Propagation;

/// Received signal strength alone: z = P(d) in dBm, d the slant range (Pritzl 2018, eq. 3.7).
///
/// Works on every state whose first components are the target's East and North.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rss<P> {
    propagation: P,
    target_up: f64,
}

impl<P: Propagation> Rss<P> {
    /// The model for a target on the ground, Up = 0.
    #[must_use]
    pub fn new(propagation: P) -> Self {
        Self { propagation, target_up: 0.0 }
    }

    /// Sets the height of the target, in metres.
    ///
    /// # Errors
    ///
    /// If the height is not finite.
    pub fn with_target_up(self, target_up: f64) -> Result<Self, ParameterError> {
        Ok(Self { target_up: parameter::finite("target_up", target_up)?, ..self })
    }

    /// The law of received power over range.
    #[must_use]
    pub fn propagation(&self) -> &P {
        &self.propagation
    }
}

impl<P: Propagation, const N: usize> MeasurementModel<N, 1> for Rss<P> {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::RSS]
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> Vector1<f64> {
        let sight = Sight::new(state, receiver, self.target_up);
        Vector1::new(self.propagation.rss_dbm(sight.range()))
    }

    #[inline(always)]
    fn expected_change(
        &self,
        state: &State<N>,
        expected: &Vector1<f64>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> Vector1<f64> {
        let [odd, even] = self.expected_parts(state, expected, offset, receiver);
        odd + even
    }

    /// Computes them from the changes of range and bearing, where these are plain: no large numbers
    /// are subtracted.
    #[inline(always)]
    fn expected_parts(
        &self,
        state: &State<N>,
        expected: &Vector1<f64>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> [Vector1<f64>; 2] {
        let parts = Sight::new(state, receiver, self.target_up).parts(offset[0], offset[1]);
        match (parts, self.propagation.log_slope()) {
            (Some((logs, _)), Some(slope)) => logs.map(|log| Vector1::new(slope * log)),
            _ => differences(self, *state, *expected, *offset, receiver),
        }
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, 1, N> {
        let sight = Sight::new(state, receiver, self.target_up);
        let mut jacobian = SMatrix::<f64, 1, N>::zeros();
        [jacobian[(0, 0)], jacobian[(0, 1)]] = sight.power_slope(&self.propagation);
        jacobian
    }

    fn residuals(
        &self,
        columns: [&[f64]; N],
        z: &Vector1<f64>,
        receiver: &Pose,
        [out]: [&mut [f64]; 1],
    ) {
        run(LevelResiduals {
            law: &self.propagation,
            parameters: [],
            places: [columns[0], columns[1]],
            target_up: self.target_up,
            receiver,
            level: z[0],
            out,
        });
    }
}
