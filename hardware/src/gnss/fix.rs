use std::f64::consts::SQRT_2;

use foxhunt_wire::{
    FixQuality,
    geodesy::{Geodetic, compass_deg_to_radians},
};
use nalgebra::Vector3;

/// A receiver's solution of one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GnssFix {
    /// Time of the fix in seconds of UNIX time, by the receiver; `None` while it does not know the
    /// date.
    pub utc_s: Option<f64>,
    /// Place of its antenna; `None` without a fix. The height of a [`flat`](Self::flat) fix is that
    /// of the last one that had a height.
    pub place: Option<Geodetic>,
    /// True if it has no height of its own: a 2D fix.
    pub flat: bool,
    /// Quality of the fix.
    pub quality: FixQuality,
    /// σ of East, North and Up in metres, as the receiver reports; `None` where it does not.
    pub sigma_m: Option<Vector3<f64>>,
    /// Velocity of the antenna to East, North and Up in metres per second, where that is known.
    pub velocity_mps: Option<Vector3<f64>>,
    /// Number of satellites that it uses, where it reports that.
    pub satellites: Option<u32>,
    /// The horizontal dilution of precision, where it reports that.
    pub hdop: Option<f64>,
}

/// A number that can be a standard deviation or a dilution.
pub(super) fn sane(value: f64) -> Option<f64> {
    (value.is_finite() && value > 0.0).then_some(value)
}

/// σ of East, North and Up, where all three can be.
pub(super) fn sane_sigma(east: f64, north: f64, up: f64) -> Option<Vector3<f64>> {
    Some(Vector3::new(sane(east)?, sane(north)?, sane(up)?))
}

/// σ of one axis where a horizontal accuracy is √(σ_E² + σ_N²), both alike.
pub(super) fn axis_of(horizontal: f64) -> f64 {
    horizontal / SQRT_2
}

/// The velocity of a speed over ground in the direction of a course.
pub(super) fn over_ground(
    speed_mps: f64,
    course_deg_compass: f64,
    climb_mps: f64,
) -> Option<Vector3<f64>> {
    let (sin, cos) = compass_deg_to_radians(course_deg_compass).sin_cos();
    sane_velocity(Vector3::new(speed_mps * cos, speed_mps * sin, climb_mps))
}

/// A velocity, where all three numbers are finite.
pub(super) fn sane_velocity(velocity: Vector3<f64>) -> Option<Vector3<f64>> {
    velocity.iter().all(|mps| mps.is_finite()).then_some(velocity)
}

/// Milliseconds as seconds.
#[expect(
    clippy::cast_precision_loss,
    reason = "dates of this age have less than 2^53 milliseconds"
)]
pub(super) fn seconds(milliseconds: i64) -> f64 {
    milliseconds as f64 / 1000.0
}
