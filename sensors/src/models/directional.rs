//! Levels through an antenna whose gain depends on the direction.

use alloc::sync::Arc;

use foxhunt_core::{
    MeasurementModel, Observation, Pose, Quantity, State, angle, columns, gaussian_log_likelihood,
    log_likelihoods_one_by_one,
    parameter::{self, ParameterError},
};
use nalgebra::{SMatrix, SVector, Vector2, Vector3};

use super::differences;
use crate::{Antenna, ElevationPattern, Propagation};

/// Nearer than this to the body's vertical axis, in metres, an elevation has no slope.
const OVERHEAD: f64 = 1e-3;

/// A model of a level received by an antenna that turns about the body's vertical axis: the mean
/// gain over the turn depends on the elevation of the beacon in the body's frame.
///
/// The model inside expects the level at the horizon in its first component, in dB; to that the
/// [`ElevationPattern`] is added; without one it is the model inside. The elevation follows from
/// the target's place and height and from the receiver's place and attitude. The noise is
/// Gaussian; a [`Censored`](crate::Censored) model goes round this one, not into it.
///
/// ```
/// use foxhunt_core::{MeasurementModel, Pose, nalgebra::{Vector1, Vector2}};
/// use foxhunt_sensors::{Dipole, ElevationPattern, LogDistance, Rss, WithElevationPattern};
/// let rss = Rss::new(LogDistance::pritzl2018_field());
/// let model = WithElevationPattern::new(rss, ElevationPattern::of(&Dipole));
/// let (drone, below) = (Pose::at(0.0, 0.0, 50.0), Vector2::new(5.0, 0.0));
/// let [through, without]: [Vector1<f64>; 2] =
///     [model.expected(&below, &drone), rss.expected(&below, &drone)];
/// assert!(through[0] < without[0] - 15.0);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct WithElevationPattern<H> {
    model: H,
    pattern: Option<Arc<ElevationPattern>>,
    target_up: f64,
}

impl<H> WithElevationPattern<H> {
    /// The model for a target on the ground, Up = 0.
    #[must_use]
    pub fn new(model: H, pattern: impl Into<Arc<ElevationPattern>>) -> Self {
        Self { model, pattern: Some(pattern.into()), target_up: 0.0 }
    }

    /// The model inside.
    #[must_use]
    pub fn model(&self) -> &H {
        &self.model
    }

    /// Another model inside, with the same pattern and the same target's height.
    #[must_use]
    pub fn map<G>(self, change: impl FnOnce(H) -> G) -> WithElevationPattern<G> {
        let Self { model, pattern, target_up } = self;
        WithElevationPattern { model: change(model), pattern, target_up }
    }

    /// Sets the height of the target, in metres, as the model inside has it.
    ///
    /// # Errors
    ///
    /// If the height is not finite.
    pub fn with_target_up(self, target_up: f64) -> Result<Self, ParameterError> {
        Ok(Self { target_up: parameter::finite("target_up", target_up)?, ..self })
    }

    /// The target as the body sees it: forward, left, up.
    fn sight<const N: usize>(&self, state: &State<N>, receiver: &Pose) -> Vector3<f64> {
        const { assert!(N >= 2, "a state holds East and North") };
        let target = Vector3::new(state[0], state[1], self.target_up);
        receiver.to_body(&(target - receiver.position))
    }
}

/// Without a pattern: the level is the same at every elevation.
impl<H> From<H> for WithElevationPattern<H> {
    fn from(model: H) -> Self {
        Self { model, pattern: None, target_up: 0.0 }
    }
}

impl<H, const N: usize, const M: usize> MeasurementModel<N, M> for WithElevationPattern<H>
where
    H: MeasurementModel<N, M>,
{
    fn quantities(&self) -> [Quantity; M] {
        self.model.quantities()
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> SVector<f64, M> {
        let mut expected = self.model.expected(state, receiver);
        let Some(pattern) = &self.pattern else { return expected };
        let (elevation, _) = elevation(&self.sight(state, receiver));
        // Beyond the largest numbers the elevation is not finite.
        if elevation.is_finite() {
            expected[0] += pattern.gain_db(elevation);
        }
        expected
    }

    fn residual(&self, z: &SVector<f64, M>, expected: &SVector<f64, M>) -> SVector<f64, M> {
        self.model.residual(z, expected)
    }

    fn expected_change(
        &self,
        state: &State<N>,
        expected: &SVector<f64, M>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> SVector<f64, M> {
        match &self.pattern {
            Some(_) => self.residual(&self.expected(&(state + offset), receiver), expected),
            None => self.model.expected_change(state, expected, offset, receiver),
        }
    }

    fn expected_parts(
        &self,
        state: &State<N>,
        expected: &SVector<f64, M>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> [SVector<f64, M>; 2] {
        match &self.pattern {
            Some(_) => differences(self, *state, *expected, *offset, receiver),
            None => self.model.expected_parts(state, expected, offset, receiver),
        }
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, M, N> {
        let mut jacobian = self.model.jacobian(state, receiver);
        let Some(pattern) = &self.pattern else { return jacobian };
        let sight = self.sight(state, receiver);
        let ((elevation, level), range) = (elevation(&sight), sight.norm());
        if level >= OVERHEAD && range.is_finite() {
            let slope = pattern.slope(elevation);
            // ∂e/∂(forward, left, up), then over East and North.
            let rise = sight.z / range;
            let run = level / range;
            let gradient = Vector3::new(
                -rise * (sight.x / level) / range,
                -rise * (sight.y / level) / range,
                run / range,
            );
            for (column, axis) in [Vector3::x(), Vector3::y()].iter().enumerate() {
                jacobian[(0, column)] += slope * gradient.dot(&receiver.to_body(axis));
            }
        }
        jacobian
    }

    fn log_likelihood(&self, state: &State<N>, observation: &Observation<M>) -> f64 {
        match &self.pattern {
            Some(_) => gaussian_log_likelihood(self, state, observation),
            None => self.model.log_likelihood(state, observation),
        }
    }

    fn log_likelihoods(&self, columns: [&[f64]; N], observation: &Observation<M>, out: &mut [f64]) {
        match &self.pattern {
            Some(_) => log_likelihoods_one_by_one(self, columns, observation, out),
            None => self.model.log_likelihoods(columns, observation, out),
        }
    }

    fn residuals(
        &self,
        columns: [&[f64]; N],
        z: &SVector<f64, M>,
        receiver: &Pose,
        out: [&mut [f64]; M],
    ) {
        let mut out = out;
        self.model.residuals(columns, z, receiver, columns::slices_mut(&mut out));
        let Some(pattern) = &self.pattern else { return };
        for (i, level) in out[0].iter_mut().enumerate() {
            let state = State::<N>::from_fn(|row, _| columns[row][i]);
            let (angle, _) = elevation(&self.sight(&state, receiver));
            if angle.is_finite() {
                *level -= pattern.gain_db(angle);
            }
        }
    }
}

/// The level of a single signal through a directional antenna at a known boresight, such as a
/// pulse of a tag: the law of propagation plus the antenna's gain towards the target over its mean
/// over a level turn, z = P(d) + G(α, ε) − Ḡ.
///
/// So P is the mean level over a turn, as in [`Rss`](super::Rss). The antenna turns about the
/// body's vertical axis; azimuth and elevation are those in the body's frame, attitude included.
///
/// ```
/// use foxhunt_core::{Pose, nalgebra::Vector2};
/// use foxhunt_sensors::{DirectionalLevel, LogDistance, PatternTable};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let law = LogDistance::new(-30.0, 2.6)?;
/// let model = DirectionalLevel::new(law, PatternTable::reference_patch());
/// let (drone, north) = (Pose::at(0.0, 0.0, 5.0), Vector2::new(0.0, 40.0));
/// let level = |boresight: f64| model.level_dbm(&north, &drone, boresight, 0.0);
/// assert!(level(90_f64.to_radians()) > level(-90_f64.to_radians()) + 10.0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct DirectionalLevel<P, A> {
    propagation: P,
    antenna: A,
    mean_db: f64,
    target_up: f64,
}

impl<P: Propagation, A: Antenna> DirectionalLevel<P, A> {
    /// The model for a target on the ground, Up = 0.
    #[must_use]
    pub fn new(propagation: P, antenna: A) -> Self {
        let mean_db = antenna.mean_gain_db(0.0);
        Self { propagation, antenna, mean_db, target_up: 0.0 }
    }

    /// Sets the height of the target, in metres.
    ///
    /// # Errors
    ///
    /// If the height is not finite.
    pub fn with_target_up(self, target_up: f64) -> Result<Self, ParameterError> {
        Ok(Self { target_up: parameter::finite("target_up", target_up)?, ..self })
    }

    /// The level in dBm of a target at `place`, East and North in metres, of an antenna that looks
    /// along `boresight` in the world, its pattern turned by `turn`; both in radians
    /// counter-clockwise.
    pub fn level_dbm(
        &self,
        place: &Vector2<f64>,
        receiver: &Pose,
        boresight: f64,
        turn: f64,
    ) -> f64 {
        let mut level = [0.0];
        self.levels_dbm(place, receiver, boresight, &[turn], &mut level);
        level[0]
    }

    /// [`level_dbm`](Self::level_dbm) for several turns of the pattern.
    pub fn levels_dbm(
        &self,
        place: &Vector2<f64>,
        receiver: &Pose,
        boresight: f64,
        turns: &[f64],
        levels: &mut [f64],
    ) {
        let sight = Vector3::new(place.x, place.y, self.target_up) - receiver.position;
        let body = receiver.to_body(&sight);
        let azimuth = libm::atan2(body.y, body.x) - (boresight - receiver.heading);
        let elevation = libm::atan2(body.z, libm::hypot(body.x, body.y));
        let mean = self.propagation.rss_dbm(sight.norm()) - self.mean_db;
        for (level, turn) in levels.iter_mut().zip(turns) {
            *level = mean + self.antenna.gain_dbi(angle::wrap(azimuth - turn), elevation);
        }
    }
}

/// The elevation of a sight, and its length over the body's level plane.
fn elevation(sight: &Vector3<f64>) -> (f64, f64) {
    let level = libm::hypot(sight.x, sight.y);
    (libm::atan2(sight.z, level), level)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Dipole, LogDistance, PatternTable};
    use approx::{abs_diff_eq, assert_abs_diff_eq};

    #[test]
    fn it_follows_the_antenna_in_the_frame_of_the_body() {
        let law = LogDistance::new(-30.0, 2.0).expect("in range");
        let antenna = PatternTable::reference_patch();
        let model = DirectionalLevel::new(law, &antenna);
        let east = Vector2::new(10.0, 0.0);
        let level = |pose: &Pose, boresight, turn| model.level_dbm(&east, pose, boresight, turn);
        // −50 dBm over a turn at 10 m.
        let expected = |azimuth: f64| -50.0 + antenna.gain_db(azimuth) - antenna.mean_gain_db(0.0);
        let flat = Pose { heading: 1.1, ..Pose::default() };
        for (boresight, turn) in [(0.0, 0.0), (0.7, 0.0), (-2.0, 0.4)] {
            let off = level(&flat, boresight, turn) - expected(-boresight - turn);
            assert!(abs_diff_eq!(off, 0.0, epsilon = 1e-9), "{boresight}, {turn}: {off}");
        }
    }

    #[test]
    fn a_body_that_is_tilted_sees_the_target_at_another_elevation() {
        let law = LogDistance::new(-30.0, 2.0).expect("in range");
        let model = DirectionalLevel::new(law, Dipole);
        let east = Vector2::new(10.0, 0.0);
        let level = |pitch| model.level_dbm(&east, &Pose { pitch, ..Pose::default() }, 0.0, 0.0);
        let off = Dipole.gain_dbi(0.0, -0.5) - Dipole.gain_dbi(0.0, 0.0);
        assert_abs_diff_eq!(level(0.5) - level(0.0), off, epsilon = 1e-9);
        assert!(off < -0.5);
    }
}
