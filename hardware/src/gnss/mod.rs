//! GNSS receivers: where a vehicle is, and how uncertain that is. A [`GnssDecoder`] makes fixes of
//! bytes, a [`GnssReceiver`] ages them, [`Placed`] and [`StillVehicle`] put them under a pose.

mod config;
mod gpsd;
mod nmea;
mod placed;
mod receiver;
#[cfg(test)]
mod tests;
mod ublox;

pub use config::{GnssConfig, GnssFloors, GnssKind};
pub use gpsd::GpsdDecoder;
pub use nmea::NmeaDecoder;
pub use placed::{Placed, PlacedError, StillVehicle};
pub use receiver::{GnssError, GnssPosition, GnssReceiver, Positioning};
pub use ublox::UbloxDecoder;

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

/// Makes fixes of the bytes of a receiver, however they are cut, and finds its way back after bytes
/// that mean nothing. It holds a bounded number of bytes.
///
/// A decoder of lines with latitude, longitude and height:
///
/// ```
/// use foxhunt_hardware::{FixQuality, GnssDecoder, GnssFix};
/// use foxhunt_wire::geodesy::Geodetic;
///
/// #[derive(Default)]
/// struct Lines {
///     line: Vec<u8>,
///     messages: u64,
///     refused: u64,
/// }
///
/// fn place(line: &[u8]) -> Option<Geodetic> {
///     let text = str::from_utf8(line).ok()?;
///     let mut numbers = text.split_whitespace().map_while(|number| number.parse().ok());
///     Geodetic::new(numbers.next()?, numbers.next()?, numbers.next()?).ok()
/// }
///
/// impl GnssDecoder for Lines {
///     fn name(&self) -> &'static str {
///         "lines"
///     }
///
///     fn set_up(&self) -> Vec<u8> {
///         Vec::new()
///     }
///
///     fn decode(&mut self, bytes: &[u8], emit: &mut dyn FnMut(GnssFix)) {
///         for &byte in bytes {
///             if byte == b'\n' {
///                 let place = place(&self.line);
///                 self.line.clear();
///                 self.messages += u64::from(place.is_some());
///                 self.refused += u64::from(place.is_none());
///                 if place.is_some() {
///                     let quality = FixQuality::Autonomous;
///                     emit(GnssFix { place, quality, ..GnssFix::default() });
///                 }
///             } else if self.line.len() < 100 {
///                 self.line.push(byte);
///             }
///         }
///     }
///
///     fn reset(&mut self) {
///         self.line.clear();
///     }
///
///     fn messages(&self) -> u64 {
///         self.messages
///     }
///
///     fn refused(&self) -> u64 {
///         self.refused
///     }
/// }
///
/// let mut fixes = Vec::new();
/// let mut decoder = Lines::default();
/// decoder.decode(b"50.1 14.5 400\n50.1 14.", &mut |fix| fixes.push(fix));
/// assert_eq!((fixes.len(), decoder.messages(), decoder.refused()), (1, 1, 0));
/// ```
pub trait GnssDecoder {
    /// Returns the name of its protocol, such as `NMEA`.
    fn name(&self) -> &'static str;

    /// Returns the bytes to send to the receiver so that it sends fixes; empty if it does so by
    /// itself.
    fn set_up(&self) -> Vec<u8>;

    /// Takes bytes; hands on each fix that they complete. A fix may be repeated when
    /// its σ comes later.
    fn decode(&mut self, bytes: &[u8], emit: &mut dyn FnMut(GnssFix));

    /// Forgets what was begun and what came of the receiver: it may be another one now.
    fn reset(&mut self);

    /// Returns the number of whole messages until now, including those without a fix.
    fn messages(&self) -> u64;

    /// Returns the number of messages that were refused until now: a wrong checksum, or malformed.
    fn refused(&self) -> u64;
}

impl<D: GnssDecoder + ?Sized> GnssDecoder for Box<D> {
    fn name(&self) -> &'static str {
        (**self).name()
    }
    fn set_up(&self) -> Vec<u8> {
        (**self).set_up()
    }
    fn decode(&mut self, bytes: &[u8], emit: &mut dyn FnMut(GnssFix)) {
        (**self).decode(bytes, emit);
    }
    fn reset(&mut self) {
        (**self).reset();
    }
    fn messages(&self) -> u64 {
        (**self).messages()
    }
    fn refused(&self) -> u64 {
        (**self).refused()
    }
}

/// Gathers lines of text of at most `limit` bytes; what is longer, or no text, is dropped.
#[derive(Clone, Debug)]
struct Line {
    bytes: Vec<u8>,
    limit: usize,
    /// Byte that begins a line, and drops what came before it in the same line.
    begin: Option<u8>,
    /// True if this line has become too long: its rest means nothing.
    skips: bool,
}

impl Line {
    fn new(limit: usize, begin: Option<u8>) -> Self {
        Self { bytes: Vec::new(), limit, begin, skips: begin.is_some() }
    }

    /// Forgets what was begun.
    fn clear(&mut self) {
        self.bytes.clear();
        self.skips = self.begin.is_some();
    }

    /// Takes a byte; the line that it ends, without its end.
    fn push<T>(&mut self, byte: u8, whole: impl FnOnce(&str) -> T) -> Option<T> {
        if matches!(byte, b'\r' | b'\n') {
            let text = str::from_utf8(&self.bytes).ok().filter(|text| !text.is_empty());
            let line = text.map(whole);
            self.clear();
            return line;
        }
        if self.begin == Some(byte) {
            self.bytes.clear();
            self.skips = false;
        }
        if !self.skips {
            if self.bytes.len() == self.limit {
                self.bytes.clear();
                self.skips = true;
            } else {
                self.bytes.push(byte);
            }
        }
        None
    }
}

/// A number that can be a standard deviation or a dilution.
fn sane(value: f64) -> Option<f64> {
    (value.is_finite() && value > 0.0).then_some(value)
}

/// σ of East, North and Up, where all three can be.
fn sane_sigma(east: f64, north: f64, up: f64) -> Option<Vector3<f64>> {
    Some(Vector3::new(sane(east)?, sane(north)?, sane(up)?))
}

/// σ of one axis where a horizontal accuracy is √(σ_E² + σ_N²), both alike.
fn axis_of(horizontal: f64) -> f64 {
    horizontal / SQRT_2
}

/// The velocity of a speed over ground in the direction of a course.
fn over_ground(speed_mps: f64, course_deg_compass: f64, climb_mps: f64) -> Option<Vector3<f64>> {
    let (sin, cos) = compass_deg_to_radians(course_deg_compass).sin_cos();
    sane_velocity(Vector3::new(speed_mps * cos, speed_mps * sin, climb_mps))
}

/// A velocity, where all three numbers are finite.
fn sane_velocity(velocity: Vector3<f64>) -> Option<Vector3<f64>> {
    velocity.iter().all(|mps| mps.is_finite()).then_some(velocity)
}

/// Milliseconds as seconds.
#[expect(
    clippy::cast_precision_loss,
    reason = "dates of this age have less than 2^53 milliseconds"
)]
fn seconds(milliseconds: i64) -> f64 {
    milliseconds as f64 / 1000.0
}
