//! Levels through an antenna whose gain depends on the direction.

use alloc::sync::Arc;

use foxhunt_core::{
    Pose, angle,
    parameter::{self, ParameterError},
};
use nalgebra::{Vector2, Vector3};

use super::{ChangedLevel, LevelChange, OverTerrain};
use crate::{Antenna, ElevationPattern, Propagation};

/// Nearer than this to the body's vertical axis, in metres, an elevation has no slope.
const OVERHEAD: f64 = 1e-3;

/// A model of a level received by an antenna that turns about the body's vertical axis: the mean
/// gain over the turn depends on the elevation of the beacon in the body's frame.
///
/// The model inside expects the level at the horizon in its first component, in dB; to that the
/// [`ElevationPattern`] is added; without one it is the model inside. The elevation follows from
/// the target's place and height and from the receiver's place and attitude.
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
pub type WithElevationPattern<H> = ChangedLevel<H, Arc<ElevationPattern>>;

impl<H> WithElevationPattern<H> {
    /// The model for a target on the ground, Up = 0.
    #[must_use]
    pub fn new(model: H, pattern: impl Into<Arc<ElevationPattern>>) -> Self {
        Self::changed(model, pattern.into())
    }
}

/// Without terrain and without an antenna's vertical pattern.
impl<H, G> From<H> for OverTerrain<WithElevationPattern<H>, G> {
    fn from(model: H) -> Self {
        WithElevationPattern::from(model).into()
    }
}

impl LevelChange for Arc<ElevationPattern> {
    fn change_db(&self, target: &Vector3<f64>, receiver: &Pose) -> f64 {
        let (elevation, _) = elevation(&receiver.to_body(&(target - receiver.position)));
        // Beyond the largest numbers the elevation is not finite.
        if elevation.is_finite() { self.gain_db(elevation) } else { 0.0 }
    }

    fn slope_db_per_m(&self, target: &Vector3<f64>, receiver: &Pose) -> Vector2<f64> {
        let sight = receiver.to_body(&(target - receiver.position));
        let ((elevation, level), range) = (elevation(&sight), sight.norm());
        if !(level >= OVERHEAD && range.is_finite()) {
            return Vector2::zeros();
        }
        let slope = self.slope(elevation);
        // ∂e/∂(forward, left, up), then over East and North.
        let rise = sight.z / range;
        let run = level / range;
        let gradient = Vector3::new(
            -rise * (sight.x / level) / range,
            -rise * (sight.y / level) / range,
            run / range,
        );
        let along = |axis| slope * gradient.dot(&receiver.to_body(&axis));
        Vector2::new(along(Vector3::x()), along(Vector3::y()))
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
