//! Differences between a receiver and a reference receiver: of levels, and of ranges.

use foxhunt_core::{
    MeasurementModel, Pose, Quantity, State,
    parameter::{self, ParameterError},
    vectorised::{Kernel, run},
};
use nalgebra::{SMatrix, Vector1, Vector3};

use super::{BLOCK, LevelResiduals, Sight};
use crate::{LogDistance, Propagation};

/// The level at the receiver less the level at a reference receiver: z = P(d) − P(d₀) = −10
/// γ log₁₀(d / d₀) in dB.
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

/// The target's distance from the receiver less its distance from a reference receiver: z = d − d₀
/// in metres, both slant ranges.
///
/// It follows from a time difference of arrival: z = c τ with c the
/// [`SPEED_OF_LIGHT`](Self::SPEED_OF_LIGHT) and τ the arrival at the receiver less that at the
/// reference, in seconds; σ scales alike. Metres keep a value and its slope of order one.
///
/// Two receivers that received one emission along with the reference share its error: their
/// differences are correlated by one half. Where that matters, take another pair's.
///
/// Works on every state whose first components are the target's East and North.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeDifference {
    reference: Pose,
    target_up: f64,
}

impl RangeDifference {
    /// c in metres per second, in vacuum; 0.03 % more than in air.
    pub const SPEED_OF_LIGHT: f64 = 299_792_458.0;

    /// The model for a reference receiver at this place, East, North and Up in metres, and a target
    /// on the ground, Up = 0.
    ///
    /// # Errors
    ///
    /// If the place is not finite.
    pub fn new(reference: Vector3<f64>) -> Result<Self, ParameterError> {
        Ok(Self { reference: reference_at(reference)?, target_up: 0.0 })
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

impl<const N: usize> MeasurementModel<N, 1> for RangeDifference {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::RANGE_DIFFERENCE]
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> Vector1<f64> {
        let own = Sight::new(state, receiver, self.target_up).range();
        let reference = Sight::new(state, &self.reference, self.target_up).range();
        // Two ranges that overflow are equal in f64.
        let difference = own - reference;
        Vector1::new(if difference.is_finite() { difference } else { 0.0 })
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, 1, N> {
        let own = Sight::new(state, receiver, self.target_up).range_slope();
        let reference = Sight::new(state, &self.reference, self.target_up).range_slope();
        let mut jacobian = SMatrix::<f64, 1, N>::zeros();
        jacobian[(0, 0)] = own[0] - reference[0];
        jacobian[(0, 1)] = own[1] - reference[1];
        jacobian
    }

    fn residuals(
        &self,
        columns: [&[f64]; N],
        z: &Vector1<f64>,
        receiver: &Pose,
        [out]: [&mut [f64]; 1],
    ) {
        let places = [columns[0], columns[1]];
        let target_up = self.target_up;
        let receivers = [receiver, &self.reference].map(|pose| pose.position);
        run(Differences { places, target_up, receivers, difference: z[0], out });
    }
}

/// A measured difference of ranges less the differences of many targets; sets `out`.
struct Differences<'a> {
    /// East and North.
    places: [&'a [f64]; 2],
    target_up: f64,
    /// Places of the receiver and the reference.
    receivers: [Vector3<f64>; 2],
    difference: f64,
    out: &'a mut [f64],
}

impl Kernel for Differences<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let ups = self.receivers.map(|place| self.target_up - place.z);
        for ((out, east), north) in self.out.iter_mut().zip(self.places[0]).zip(self.places[1]) {
            let range = |i: usize| {
                let x = east - self.receivers[i].x;
                let y = north - self.receivers[i].y;
                libm::sqrt(x * x + y * y + ups[i] * ups[i])
            };
            let expected = range(0) - range(1);
            let expected = if expected.is_finite() { expected } else { 0.0 };
            *out = self.difference - expected;
        }
    }
}

/// A reference receiver's pose.
fn reference_at(place: Vector3<f64>) -> Result<Pose, ParameterError> {
    Ok(Pose::at(
        parameter::finite("the reference's East", place.x)?,
        parameter::finite("the reference's North", place.y)?,
        parameter::finite("the reference's Up", place.z)?,
    ))
}
