//! Poses and way points, the vehicles that go there, and the ground below them.

use core::{fmt, fmt::Debug};

use nalgebra::{Quaternion, UnitQuaternion, Vector2, Vector3};

use crate::angle::Resultant;

/// A drone's place and attitude in the local East-North-Up frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Pose {
    /// East, North and Up in metres.
    pub position: Vector3<f64>,
    /// The nose, in radians counter-clockwise from East.
    pub heading: f64,
    /// Angle of the nose above the horizon, in radians; 0 where a file has no value.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "is_zero"))]
    pub pitch: f64,
    /// Angle of the right side below the left, in radians; 0 where a file has no value.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "is_zero"))]
    pub roll: f64,
    /// Velocity to East, North and Up, in metres per second, where that is known.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub velocity: Option<Vector3<f64>>,
}

impl Pose {
    /// A level pose with the nose to the East.
    #[must_use]
    pub fn at(east: f64, north: f64, up: f64) -> Self {
        Self { position: Vector3::new(east, north, up), ..Self::default() }
    }

    /// A level pose.
    #[must_use]
    pub fn level(position: Vector3<f64>, heading: f64) -> Self {
        Self { position, heading, ..Self::default() }
    }

    /// The mean of poses, [`None`] of none: with a velocity where all of them have one, and level
    /// where the body turned meanwhile. Of headings that cancel the last one stands.
    #[must_use]
    pub fn mean<'p>(poses: impl IntoIterator<Item = &'p Self>) -> Option<Self> {
        let mut last = None;
        let mut heading = Resultant::default();
        let mut sum = Self { velocity: Some(Vector3::zeros()), ..Self::default() };
        let mut count = 0.0;
        // A drone that hovers has one heading for all poses.
        let mut held = f64::NAN;
        let mut unit = Resultant::default();
        for pose in poses {
            if pose.heading.to_bits() != held.to_bits() {
                held = pose.heading;
                unit = Resultant::from_iter([held]);
            }
            heading += unit;
            sum.position += pose.position;
            sum.pitch += pose.pitch;
            sum.roll += pose.roll;
            sum.velocity = sum.velocity.zip(pose.velocity).map(|(sum, velocity)| sum + velocity);
            count += 1.0;
            last = Some(pose.heading);
        }
        let last = last?;
        // The attitude of a body that turned meanwhile is that of no one heading.
        if heading.length() < HELD {
            sum.pitch = 0.0;
            sum.roll = 0.0;
        }
        Some(Self {
            position: sum.position / count,
            heading: heading.direction(1e-9).unwrap_or(last),
            pitch: sum.pitch / count,
            roll: sum.roll / count,
            velocity: sum.velocity.map(|sum| sum / count),
        })
    }

    /// A direction of the world frame in the body's own: forward, left and up along its axes.
    ///
    /// The body is turned by heading about Up, then by pitch about its left axis, then by roll
    /// about its nose.
    #[must_use]
    pub fn to_body(&self, world: &Vector3<f64>) -> Vector3<f64> {
        let turned = |a: f64, b: f64, angle: f64| {
            let sin = libm::sin(angle);
            let cos = libm::cos(angle);
            (cos * a + sin * b, cos * b - sin * a)
        };
        let (forward, left) = turned(world.x, world.y, self.heading);
        let (forward, up) = turned(forward, world.z, self.pitch);
        let (left, up) = turned(left, up, self.roll);
        Vector3::new(forward, left, up)
    }

    /// Rotation of the body's axes forward, left and up into the world.
    #[must_use]
    pub fn rotation(&self) -> UnitQuaternion<f64> {
        let about = |axis: Vector3<f64>, angle: f64| {
            let half = 0.5 * angle;
            Quaternion::from_parts(libm::cos(half), axis * libm::sin(half))
        };
        // A nose that rises turns the other way about the axis to the left.
        let heading = about(Vector3::z(), self.heading);
        let pitch = about(Vector3::y(), -self.pitch);
        UnitQuaternion::new_normalize(heading * pitch * about(Vector3::x(), self.roll))
    }

    /// Sets heading, pitch and roll from a [`rotation`](Self::rotation). With the nose straight up
    /// or down only the sum or the difference of heading and roll is known.
    #[must_use]
    pub fn with_rotation(self, rotation: &UnitQuaternion<f64>) -> Self {
        let [i, j, k] = rotation.imag().into();
        let w = rotation.scalar();
        let up_of_nose = 2.0 * (i * k - w * j);
        Self {
            heading: libm::atan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k)),
            pitch: libm::asin(up_of_nose.clamp(-1.0, 1.0)),
            roll: libm::atan2(2.0 * (w * i + j * k), 1.0 - 2.0 * (i * i + j * j)),
            ..self
        }
    }

    /// Returns true if every number in it is finite.
    #[must_use]
    #[inline]
    pub fn is_finite(&self) -> bool {
        let Self { position, heading, pitch, roll, velocity } = self;
        // Zero times a number that is not finite is NaN.
        let zero = |v: &Vector3<f64>| 0.0 * v.x + 0.0 * v.y + 0.0 * v.z;
        let angles = 0.0 * heading + 0.0 * pitch + 0.0 * roll;
        (zero(position) + angles + velocity.as_ref().map_or(0.0, zero)).is_finite()
    }
}

/// Headings whose mean resultant is shorter than this, which is a spread of 8°, did not hold.
const HELD: f64 = 0.99;

/// A place to fly to, East, North and Up in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Waypoint {
    /// East, North and Up in metres.
    pub position: Vector3<f64>,
}

/// A beacon's index in the hunt's list of beacons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(transparent))]
pub struct BeaconId(pub u16);

/// An aircraft's motion until something happens: straight, at constant speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteadyMotion {
    /// East, North and Up in metres per second; zero for one that stays where it is.
    pub velocity: Vector3<f64>,
    /// Time until which that holds, in seconds of its clock.
    pub until: f64,
}

/// An aircraft that reports its pose and flies to places.
pub trait Vehicle {
    /// Failure of the link or the autopilot.
    type Error: core::error::Error + 'static;

    /// The aircraft's present pose.
    ///
    /// # Errors
    ///
    /// Any failure of the link.
    fn pose(&mut self) -> Result<Pose, Self::Error>;

    /// σ of its place to East, North and Up in metres, as of the last [`pose`](Self::pose); `None`,
    /// unless overridden, where it does not report that.
    fn position_sigma(&self) -> Option<Vector3<f64>> {
        None
    }

    /// Orders a flight to `goal`; returns when the order is accepted, not on arrival.
    ///
    /// # Errors
    ///
    /// Any failure of the link, or the autopilot's refusal.
    fn go_to(&mut self, goal: &Waypoint) -> Result<(), Self::Error>;

    /// Lands it where it is; returns when the order is accepted. Unless overridden, it is sent to
    /// the ground below, an Up of 0.
    ///
    /// # Errors
    ///
    /// Any failure of the link, or the autopilot's refusal.
    fn land(&mut self) -> Result<(), Self::Error> {
        let mut position = self.pose()?.position;
        position.z = 0.0;
        self.go_to(&Waypoint { position })
    }

    /// Motion of its [`pose`](Self::pose), and the time until which it neither changes otherwise
    /// nor fails, unless it is given an order: a simulated aircraft may know. `None`, unless
    /// overridden, where that is not known.
    ///
    /// A simulation goes from one event to the next and leaves out the looks in between.
    fn steady_motion(&self) -> Option<SteadyMotion> {
        None
    }
}

/// An aircraft that can turn about its vertical axis for as long as it is ordered to, while it
/// hovers and while it flies.
pub trait Spinner: Vehicle {
    /// Turns at `rate` radians per second, counter-clockwise from above where it is positive, until
    /// the next order; `None` holds the heading. Returns when the order is accepted. The place that
    /// it flies to is another matter.
    ///
    /// # Errors
    ///
    /// Any failure of the link, or the autopilot's refusal.
    fn spin(&mut self, rate: Option<f64>) -> Result<(), Self::Error>;
}

/// A vehicle's height above the ground below it, by its own devices.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct HeightAboveGround {
    /// The height in metres.
    pub metres: f64,
    /// The source of the height.
    pub source: HeightSource,
}

/// Source of a vehicle's own height above the ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum HeightSource {
    /// A distance sensor that looks down.
    Rangefinder,
    /// The vehicle's place above the terrain that its autopilot has: tiles, or an estimate.
    Terrain,
}

impl fmt::Display for HeightSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Rangefinder => "rangefinder",
            Self::Terrain => "the autopilot's terrain",
        })
    }
}

/// The height of the ground: an elevation model, or a formula.
///
/// ```
/// use foxhunt_core::{Terrain, nalgebra::Vector2};
///
/// /// A slope that rises by a metre in ten towards the East.
/// #[derive(Debug)]
/// struct Slope;
///
/// impl Terrain for Slope {
///     fn height(&self, place: &Vector2<f64>) -> Option<f64> {
///         Some(0.1 * place.x)
///     }
///
///     fn step_m(&self) -> f64 {
///         50.0
///     }
/// }
///
/// assert!(Slope.height(&Vector2::new(20.0, 5.0)).is_some_and(|m| (m - 2.0).abs() < 1e-12));
/// ```
///
/// # Laws
///
/// A height is finite, and always the same at the same place; the step is a positive number.
pub trait Terrain: Debug {
    /// The height of the ground at a place, East and North in metres, in metres above whatever the
    /// terrain counts from, which is the same everywhere; `None` where it is not known.
    fn height(&self, place: &Vector2<f64>) -> Option<f64>;

    /// Distance along a line between the places whose heights are looked at, in metres, so that
    /// nothing that matters lies between two of them.
    fn step_m(&self) -> f64;
}

#[cfg(feature = "serde")]
fn is_zero(angle: &f64) -> bool {
    angle.to_bits() == 0
}

#[cfg(test)]
mod tests {
    use approx::abs_diff_eq;
    use core::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn a_mean_pose_has_the_mean_velocity_where_all_have_one() {
        let with = [1.0, 2.0, 6.0].map(|east| {
            let velocity = Some(Vector3::new(east, -east, 0.0));
            Pose { velocity, pitch: 0.1 * east, ..Pose::at(east, 2.0, 3.0) }
        });
        let mean = Pose::mean(&with).expect("there are three");
        assert_eq!(mean.velocity, Some(Vector3::new(3.0, -3.0, 0.0)));
        assert!((mean.position - Vector3::new(3.0, 2.0, 3.0)).norm() < 1e-15);
        assert!((mean.pitch - 0.3).abs() < 1e-15, "{}", mean.pitch);
        let one_without = [with[0], Pose::default(), with[1]];
        assert_eq!(Pose::mean(&one_without).map(|pose| pose.velocity), Some(None));
        assert_eq!(Pose::mean(&[]), None);
    }

    #[test]
    fn a_mean_pose_of_a_turn_is_level_and_has_its_last_heading() {
        let turn = [0.0, FRAC_PI_2, -core::f64::consts::PI, -FRAC_PI_2].map(|heading| Pose {
            pitch: 0.2,
            roll: -0.1,
            ..Pose::level(Vector3::zeros(), heading)
        });
        let mean = Pose::mean(&turn).expect("there are four");
        assert_eq!(mean, Pose::level(Vector3::zeros(), -FRAC_PI_2));
    }

    #[test]
    fn nose_and_right_side_follow_the_angles() {
        let [east, north, up] = [Vector3::x(), Vector3::y(), Vector3::z()];
        let level = Pose::level(Vector3::zeros(), FRAC_PI_2);
        assert!((level.to_body(&north) - Vector3::x()).norm() < 1e-15, "the nose is to the North");
        assert!((level.to_body(&east) + Vector3::y()).norm() < 1e-15, "East is to the right");
        let climbing = Pose { pitch: 0.3, ..level };
        let nose = north * 0.3_f64.cos() + up * 0.3_f64.sin();
        assert!((climbing.to_body(&nose) - Vector3::x()).norm() < 1e-15, "the nose is up");
        let banked = Pose { roll: 0.3, ..level };
        let right = east * 0.3_f64.cos() - up * 0.3_f64.sin();
        assert!((banked.to_body(&right) + Vector3::y()).norm() < 1e-15, "the right side is down");
        let any = Pose { heading: 1.0, pitch: -0.4, roll: 0.7, ..level };
        let body = any.to_body(&Vector3::new(1.0, 2.0, 3.0));
        assert!(abs_diff_eq!(body.norm_squared(), 14.0, epsilon = 1e-12), "turning keeps lengths");
    }

    #[test]
    fn a_rotation_is_that_of_the_angles_and_gives_them_back() {
        for [heading, pitch, roll] in [[0.0; 3], [2.5, 0.3, -0.4], [-3.0, -1.2, 2.8]] {
            let pose = Pose { heading, pitch, roll, ..Pose::at(1.0, 2.0, 3.0) };
            for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
                assert!((pose.to_body(&(pose.rotation() * axis)) - axis).norm() < 1e-12);
            }
            let back = Pose::at(1.0, 2.0, 3.0).with_rotation(&pose.rotation());
            let errors = [back.heading - heading, back.pitch - pitch, back.roll - roll];
            assert!(errors.iter().all(|error| error.abs() < 1e-12), "{back:?} of {pose:?}");
            assert_eq!(back.position, pose.position);
        }
    }
}
