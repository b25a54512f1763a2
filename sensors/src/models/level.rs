//! Levels alone, and with a bearing, of a transmitter whose law is known or partly known.

use core::f64::consts::TAU;

use foxhunt_core::{
    MeasurementModel, Observation, Pose, Quantity, State, angle, columns, elementary,
    log_likelihoods_one_by_one,
    parameter::{self, ParameterError},
    vectorised::{Kernel, run},
};
use nalgebra::{RowVector2, SMatrix, Vector1, Vector2};

use super::{
    BLOCK, BearingResiduals, FreePathLoss, FreePower, LevelLaw, LevelResiduals, Sight, differences,
};
use crate::{LogDistance, Propagation};

/// Signal strength and bearing of a transmitter whose law of the level is known: any
/// [`Propagation`], over states whose first components are the target's East and North.
pub type RssBearing<L> = LevelBearing<L, 0>;

/// Signal strength and bearing of a transmitter whose power nobody calibrated: the last state
/// component is its P₀ in dBm, z = [P₀ − 10 γ log₁₀ d, atan2(N, E)] with γ known.
///
/// The state is (East, North, …, P₀), N ≥ 3.
pub type FreePowerRssBearing = LevelBearing<FreePower, 1>;

/// Signal strength and bearing where neither power nor exponent is known: the last two state
/// components are P₀ in dBm and γ, z = [P₀ − 10 γ log₁₀ d, atan2(N, E)].
///
/// The state is (East, North, …, P₀, γ), N ≥ 4. Power and exponent can only be distinguished
/// from several ranges: give both a prior that means something.
pub type FreePathLossRssBearing = LevelBearing<FreePathLoss, 2>;

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

/// Signal strength and bearing, z = [P(d) in dBm, atan2(N, E) in radians] (Pritzl 2018, eq. 3.7),
/// of a transmitter whose law of the level has `P` unknown parameters.
///
/// d is the slant range; the bearing is the direction from the receiver to the target in the
/// world frame. Exactly over the target the bearing is 0 with a zero Jacobian: it holds nothing.
/// The state is (East, North, …, the law's parameters), N ≥ 2 + P. For a transmitter without
/// bearings leave the bearing out of the observations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelBearing<L, const P: usize> {
    law: L,
    target_up: f64,
}

impl<L: Propagation> LevelBearing<L, 0> {
    /// The model for a target on the ground, Up = 0.
    #[must_use]
    pub fn new(propagation: L) -> Self {
        Self::with_law(propagation)
    }

    /// The law of received power over range.
    #[must_use]
    pub fn propagation(&self) -> &L {
        &self.law
    }
}

impl LevelBearing<FreePower, 1> {
    /// The model for a target on the ground, Up = 0, and the path-loss exponent γ.
    ///
    /// # Errors
    ///
    /// If the exponent is not a positive number.
    pub fn new(exponent: f64) -> Result<Self, ParameterError> {
        Ok(Self::with_law(FreePower::new(exponent)?))
    }
}

impl LevelBearing<FreePathLoss, 2> {
    /// The model for a target on the ground, Up = 0.
    #[must_use]
    pub fn new() -> Self {
        Self::with_law(FreePathLoss)
    }
}

/// The model of [`new`](FreePathLossRssBearing::new).
impl Default for LevelBearing<FreePathLoss, 2> {
    fn default() -> Self {
        Self::new()
    }
}

/// The law with its reference power forgotten.
impl From<RssBearing<LogDistance>> for FreePowerRssBearing {
    fn from(known: RssBearing<LogDistance>) -> Self {
        Self { law: known.law.into(), target_up: known.target_up }
    }
}

impl<L: LevelLaw<P>, const P: usize> LevelBearing<L, P> {
    /// The model for a target on the ground, Up = 0, and a law of its level.
    #[must_use]
    pub fn with_law(law: L) -> Self {
        Self { law, target_up: 0.0 }
    }

    /// Sets the target's height in metres.
    ///
    /// # Errors
    ///
    /// If the height is not finite.
    pub fn with_target_up(self, target_up: f64) -> Result<Self, ParameterError> {
        Ok(Self { target_up: parameter::finite("target_up", target_up)?, ..self })
    }

    /// The law of the level.
    #[must_use]
    pub fn law(&self) -> &L {
        &self.law
    }

    /// The height of the target above the ground, in metres.
    #[must_use]
    pub fn target_up(&self) -> f64 {
        self.target_up
    }
}

impl<L: LevelLaw<P>, const P: usize, const N: usize> MeasurementModel<N, 2> for LevelBearing<L, P> {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::RSS, Quantity::BEARING]
    }

    #[inline(always)]
    fn expected(&self, state: &State<N>, receiver: &Pose) -> Vector2<f64> {
        let sight = Sight::new(state, receiver, self.target_up);
        let level = sight.level_dbm(&self.law, &parameters::<N, P, _>(|i| state[i]));
        Vector2::new(level, sight.bearing())
    }

    #[inline(always)]
    fn expected_change(
        &self,
        state: &State<N>,
        expected: &Vector2<f64>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> Vector2<f64> {
        let [odd, even] = self.expected_parts(state, expected, offset, receiver);
        odd + even
    }

    /// Computes them from the changes of range and bearing, where these are plain: no large numbers
    /// are subtracted.
    #[inline(always)]
    fn expected_parts(
        &self,
        state: &State<N>,
        expected: &Vector2<f64>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> [Vector2<f64>; 2] {
        let parts = Sight::new(state, receiver, self.target_up).parts(offset[0], offset[1]);
        let (Some((logs, turns)), Some(slope)) = (parts, self.law.log_slope()) else {
            return differences(self, *state, *expected, *offset, receiver);
        };
        let mut odd = slope * logs[0];
        let even = slope * logs[1];
        if P > 0 {
            // Linear in the parameters, at any of them and at any range.
            let weights = self.law.sensitivity(&parameters::<N, P, _>(|i| state[i]), 1.0);
            let offsets = parameters::<N, P, _>(|i| offset[i]);
            weights.iter().zip(&offsets).for_each(|(weight, offset)| odd += weight * offset);
        }
        [Vector2::new(odd, turns[0]), Vector2::new(even, turns[1])]
    }

    #[inline(always)]
    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, 2, N> {
        let parameters = parameters::<N, P, _>(|i| state[i]);
        let sight = Sight::new(state, receiver, self.target_up);
        let mut jacobian = SMatrix::<f64, 2, N>::zeros();
        if let Some((along, square)) = sight.square_slope() {
            let slope = self.law.square_slope(&parameters, square);
            [jacobian[(0, 0)], jacobian[(0, 1)]] = along.map(|along| along * slope);
        }
        if P > 0 {
            let sensitivity = self.law.sensitivity(&parameters, sight.range());
            (0..P).for_each(|i| jacobian[(0, N - P + i)] = sensitivity[i]);
        }
        [jacobian[(1, 0)], jacobian[(1, 1)]] = sight.bearing_slope();
        jacobian
    }

    /// By columns, unless the receiver's place is uncertain; several directions as their mixture.
    fn log_likelihoods(&self, columns: [&[f64]; N], observation: &Observation<2>, out: &mut [f64]) {
        if observation.receiver_sigma().is_some() {
            return log_likelihoods_one_by_one(self, columns, observation, out);
        }
        let parameters = parameters::<N, P, _>(|row| columns[row]);
        let places = [columns[0], columns[1]];
        run(LogLikelihoods { model: self, parameters, places, observation, out });
    }

    fn residuals(
        &self,
        columns: [&[f64]; N],
        z: &Vector2<f64>,
        receiver: &Pose,
        [levels, bearings]: [&mut [f64]; 2],
    ) {
        let parameters = parameters::<N, P, _>(|row| columns[row]);
        let places = [columns[0], columns[1]];
        run(self.levels(parameters, places, receiver, z[0], levels));
        run(BearingResiduals { places, receiver, bearing: angle::wrap(z[1]), out: bearings });
    }
}

impl<L: LevelLaw<P>, const P: usize> LevelBearing<L, P> {
    /// The residuals of many levels.
    #[inline(always)]
    fn levels<'a>(
        &'a self,
        parameters: [&'a [f64]; P],
        places: [&'a [f64]; 2],
        receiver: &'a Pose,
        level: f64,
        out: &'a mut [f64],
    ) -> LevelResiduals<'a, L, P> {
        let law = &self.law;
        let target_up = self.target_up;
        LevelResiduals { law, parameters, places, target_up, receiver, level, out }
    }
}

/// The log-likelihood of an observation, from a receiver at a known place, for many targets.
struct LogLikelihoods<'a, L, const P: usize> {
    model: &'a LevelBearing<L, P>,
    parameters: [&'a [f64]; P],
    places: [&'a [f64]; 2],
    observation: &'a Observation<2>,
    out: &'a mut [f64],
}

impl<L: LevelLaw<P>, const P: usize> Kernel for LogLikelihoods<'_, L, P> {
    type Output = ();

    /// The noise is read once instead of once per state.
    #[inline(always)]
    fn run(self) {
        let Self { model, parameters, places, observation, out } = self;
        let receiver = observation.receiver();
        let mut residuals = [[0.0; BLOCK]; 2];
        for (direction, (weight, one)) in observation.hypotheses().enumerate() {
            let root = one
                .noise()
                .cholesky()
                .expect("an observation is only made with a positive definite noise")
                .unpack();
            // A missing component is decoupled, of unit variance, and its residual is struck out.
            let present = one.mask(RowVector2::repeat(1.0));
            let constant = libm::log(weight)
                - 0.5 * present.sum() * libm::log(TAU)
                - libm::log(root[(0, 0)] * root[(1, 1)]);
            let whiten_rss = present[0] / root[(0, 0)];
            let whiten_bearing = present[1] / root[(1, 1)];
            let coupling = root[(1, 0)];
            let level = one.value()[0];
            let bearing = angle::wrap(one.value()[1]);
            for (block, out) in out.chunks_mut(BLOCK).enumerate() {
                let rows = block * BLOCK..block * BLOCK + out.len();
                let places = columns::rows(&places, rows.clone());
                let parameters = columns::rows(&parameters, rows);
                let [levels, bearings] = columns::rows_mut(&mut residuals, 0..out.len());
                model.levels(parameters, places, receiver, level, levels).run();
                BearingResiduals { places, receiver, bearing, out: bearings }.run();
                for ((out, level), turned) in out.iter_mut().zip(levels).zip(bearings) {
                    let first = *level * whiten_rss;
                    let second = (*turned - coupling * first) * whiten_bearing;
                    let log = constant - 0.5 * (first * first + second * second);
                    *out = if direction == 0 { log } else { log_add(*out, log) };
                }
            }
        }
    }
}

/// The last components of a state.
fn parameters<const N: usize, const P: usize, T>(component: impl Fn(usize) -> T) -> [T; P] {
    const { assert!(N >= 2 + P, "a state holds East, North and the law's parameters") };
    core::array::from_fn(|i| component(N - P + i))
}

/// ln(eᵃ + eᵇ) of finite numbers.
#[inline(always)]
fn log_add(a: f64, b: f64) -> f64 {
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    high + elementary::ln(1.0 + elementary::exp(low - high))
}
