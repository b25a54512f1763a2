use foxhunt_core::{
    MeasurementModel, Pose, Quantity, State,
    parameter::{self, ParameterError},
    vectorised::run,
};
use nalgebra::{SMatrix, Vector1, Vector3};

use super::{
    Sight,
    columns::{BLOCK, LevelResiduals},
    range_difference::reference_at,
};
use crate::{LogDistance, Propagation};

/// The level at the receiver less the level at a reference receiver: z = P(d) − P(d₀) = −10 γ
/// log₁₀(d / d₀) in dB.
///
/// The transmitter's power cancels out, and with it whatever alters both levels alike; only the
/// exponent must be known (Pritzl 2018, ch. 8; Wang, Chen & Yin 2009). σ is √2 times that of one
/// level where both are alike. Two receivers that received one emission along with the reference
/// share its error: their differences are correlated by one half.
///
/// Works on every state whose first components are the target's East and North.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferentialRss {
    reference: Pose,
    /// The law with P₀ = 0.
    loss: LogDistance,
    target_up: f64,
}

impl DifferentialRss {
    /// The model for a reference receiver at this place, East, North and Up in metres, the
    /// path-loss exponent γ, and a target on the ground, Up = 0.
    ///
    /// # Errors
    ///
    /// If the place is not finite or the exponent not a positive number.
    pub fn new(reference: Vector3<f64>, exponent: f64) -> Result<Self, ParameterError> {
        let loss = LogDistance::new(0.0, exponent)?;
        Ok(Self { reference: reference_at(reference)?, loss, target_up: 0.0 })
    }

    /// Sets the height of the target, in metres.
    ///
    /// # Errors
    ///
    /// If the height is not finite.
    pub fn with_target_up(self, target_up: f64) -> Result<Self, ParameterError> {
        Ok(Self { target_up: parameter::finite("target_up", target_up)?, ..self })
    }
}

impl DifferentialRss {
    /// A level less the levels that a receiver would have of many targets.
    fn levels<'a>(
        &'a self,
        places: [&'a [f64]; 2],
        receiver: &'a Pose,
        level: f64,
        out: &'a mut [f64],
    ) -> LevelResiduals<'a, LogDistance, 0> {
        let law = &self.loss;
        let target_up = self.target_up;
        LevelResiduals { law, parameters: [], places, target_up, receiver, level, out }
    }
}

impl<const N: usize> MeasurementModel<N, 1> for DifferentialRss {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::RSS_DIFFERENCE]
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> Vector1<f64> {
        let own = Sight::new(state, receiver, self.target_up).range();
        let reference = Sight::new(state, &self.reference, self.target_up).range();
        Vector1::new(self.loss.rss_dbm(own) - self.loss.rss_dbm(reference))
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, 1, N> {
        let own = Sight::new(state, receiver, self.target_up).power_slope(&self.loss);
        let reference = Sight::new(state, &self.reference, self.target_up).power_slope(&self.loss);
        let mut jacobian = SMatrix::<f64, 1, N>::zeros();
        jacobian[(0, 0)] = own[0] - reference[0];
        jacobian[(0, 1)] = own[1] - reference[1];
        jacobian
    }

    /// The loss on the way to the reference, less that to the receiver.
    fn residuals(
        &self,
        columns: [&[f64]; N],
        z: &Vector1<f64>,
        receiver: &Pose,
        [out]: [&mut [f64]; 1],
    ) {
        let mut reference = [0.0; BLOCK];
        for (block, out) in out.chunks_mut(BLOCK).enumerate() {
            let rows = block * BLOCK..block * BLOCK + out.len();
            let places = [0, 1].map(|axis| &columns[axis][rows.clone()]);
            let reference = &mut reference[..out.len()];
            run(self.levels(places, &self.reference, 0.0, reference));
            run(self.levels(places, receiver, z[0], out));
            out.iter_mut().zip(reference).for_each(|(out, level)| *out -= *level);
        }
    }
}
