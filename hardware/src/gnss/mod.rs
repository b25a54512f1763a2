//! GNSS receivers: where a vehicle is, and how uncertain that is. A [`GnssDecoder`] makes fixes of
//! bytes, a [`GnssReceiver`] ages them, [`Placed`] and [`CarriedVehicle`] put them under a pose.

mod carried;
mod config;
mod corrections;
mod gpsd;
mod nmea;
mod placed;
mod receiver;
#[cfg(test)]
mod tests;
mod ublox;
mod ubx;

pub use carried::{CarriedConfig, CarriedError, CarriedVehicle, FixedConfig, Mark};
pub use config::{GnssConfig, GnssFloors, GnssKind};
pub use corrections::{Corrections, CorrectionsConfig, CorrectionsConfigError, CorrectionsLost};
pub use gpsd::GpsdDecoder;
pub use nmea::NmeaDecoder;
pub use placed::{Placed, PlacedError};
pub use receiver::{GnssError, GnssPosition, GnssReceiver, Positioning};
pub use ublox::UbloxDecoder;

use std::f64::consts::SQRT_2;

use foxhunt_wire::{
    FixQuality,
    geodesy::{Geodetic, compass_deg_to_radians},
    geoid::geoid_height_m,
};
use nalgebra::Vector3;

/// A receiver's solution of one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GnssFix {
    /// Time of the fix in seconds of UNIX time, by the receiver; `None` while it does not know the
    /// date.
    pub utc_s: Option<f64>,
    /// Place of its antenna; `None` without a fix.
    pub place: Option<Geodetic>,
    /// Origin of the place's height.
    pub height: HeightOrigin,
    /// Quality of the fix.
    pub quality: FixQuality,
    /// σ of East, North and Up in metres, as the receiver reports; `None` if it reports none.
    pub sigma_m: Option<Vector3<f64>>,
    /// Velocity of the antenna to East, North and Up in metres per second, where that is known.
    pub velocity_mps: Option<Vector3<f64>>,
    /// Number of satellites in use; `None` if it is not reported.
    pub satellites: Option<u32>,
    /// Horizontal dilution of precision; `None` if it is not reported.
    pub hdop: Option<f64>,
}

/// Origin of the height of a fix.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HeightOrigin {
    /// The fix itself, as a height above the ellipsoid.
    #[default]
    Fix,
    /// The fix itself, as a height above the sea; the geoid's height is that of a model.
    Geoid,
    /// The last fix that had a height: this one is flat.
    Earlier,
    /// Mean sea level: this fix is flat, and no earlier one had a height.
    SeaLevel,
}

impl HeightOrigin {
    /// Returns true if the fix has no height of its own.
    #[must_use]
    pub fn is_flat(self) -> bool {
        matches!(self, Self::Earlier | Self::SeaLevel)
    }
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

    /// Returns the direction of the vehicle's nose in radians counter-clockwise from East, by a
    /// compass or two antennas, if one came since the last call.
    fn take_heading(&mut self) -> Option<f64> {
        None
    }

    /// Returns a sentence about what the receiver does not send, and what mends it; `None` where
    /// it sends everything.
    fn missing(&self) -> Option<String> {
        None
    }
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
    fn take_heading(&mut self) -> Option<f64> {
        (**self).take_heading()
    }
    fn missing(&self) -> Option<String> {
        (**self).missing()
    }
}

const DAY_S: f64 = 86_400.0;

/// Time in seconds after which a message that no longer comes is replaced by a poorer one.
const LEADS_S: f64 = 10.0;

/// Choice among the messages of a receiver that have a place. The best one leads; a poorer one
/// from its second epoch on without a better one.
#[derive(Clone, Copy, Debug)]
struct Leader<O> {
    /// Message that gives the place, and its last time.
    leads: Option<(O, Option<f64>)>,
    /// Poorer message that leads when it comes once more.
    follows: Option<(O, Option<f64>)>,
    /// Period of the times: a day or a week, in seconds.
    period_s: f64,
}

impl<O: Copy + Ord> Leader<O> {
    fn new(period_s: f64) -> Self {
        Self { leads: None, follows: None, period_s }
    }

    /// The message that gives the place.
    fn leader(&self) -> Option<O> {
        self.leads.map(|(origin, _)| origin)
    }

    /// The message that leads when it comes once more.
    fn waits(&self) -> Option<O> {
        self.follows.map(|(origin, _)| origin)
    }

    /// True if a message gives the place: it is the `best` one, or no better one came lately.
    fn leads(&mut self, origin: O, best: O, time: Option<f64>) -> bool {
        let lately = |(_, of): &(O, Option<f64>)| match (of, time) {
            (Some(of), Some(time)) => {
                let ahead = (time - of).rem_euclid(self.period_s);
                ahead.min(self.period_s - ahead) <= LEADS_S
            }
            _ => true,
        };
        let better = |other: &(O, Option<f64>)| other.0 > origin && lately(other);
        if self.leads.as_ref().is_some_and(better) || self.follows.as_ref().is_some_and(better) {
            return false;
        }
        let already = self.leader() == Some(origin);
        let repeated =
            self.follows.is_some_and(|(same, of)| same == origin && (of != time || time.is_none()));
        if already || repeated || origin == best {
            self.leads = Some((origin, time));
            self.follows = None;
            return true;
        }
        self.follows = Some((origin, time));
        false
    }
}

/// Heights above the ellipsoid of a receiver's fixes.
#[derive(Clone, Copy, Debug, Default)]
struct Heights {
    /// Height of the last fix that had one.
    last_m: Option<f64>,
}

impl Heights {
    /// A place with a height above the ellipsoid, or without one.
    fn place(
        &mut self,
        lat_deg: f64,
        lon_deg: f64,
        alt_m: Option<f64>,
    ) -> Option<(Geodetic, HeightOrigin)> {
        let sea = Geodetic::new(lat_deg, lon_deg, 0.0).ok()?;
        let alt_m = alt_m.filter(|alt_m| alt_m.is_finite());
        self.last_m = alt_m.or(self.last_m);
        let (alt_m, origin) = match (alt_m, self.last_m) {
            (Some(own), _) => (own, HeightOrigin::Fix),
            (None, Some(last)) => (last, HeightOrigin::Earlier),
            (None, None) => (geoid_height_m(&sea), HeightOrigin::SeaLevel),
        };
        Some((Geodetic { alt_m, ..sea }, origin))
    }

    /// A place with a height above the sea and the geoid's separation, or without one of them.
    fn above_sea(
        &mut self,
        lat_deg: f64,
        lon_deg: f64,
        height: Option<(f64, Option<f64>)>,
    ) -> Option<(Geodetic, HeightOrigin)> {
        let Some((above_sea, None)) = height else {
            let alt_m = height.map(|(above_sea, geoid)| above_sea + geoid.unwrap_or(0.0));
            return self.place(lat_deg, lon_deg, alt_m);
        };
        let sea = Geodetic::new(lat_deg, lon_deg, 0.0).ok()?;
        let (place, origin) =
            self.place(lat_deg, lon_deg, Some(above_sea + geoid_height_m(&sea)))?;
        let modelled = origin == HeightOrigin::Fix;
        Some((place, if modelled { HeightOrigin::Geoid } else { origin }))
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

/// A sentence of NMEA 0183 with its checksum.
fn sentence(body: &str) -> String {
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}\r\n")
}

/// Degrees as NMEA 0183 has them: whole ones of `width` digits, minutes, and the letter of the
/// sign.
fn angle_field(deg: f64, width: usize, letters: [char; 2]) -> String {
    // Of ten-thousandths of a minute, so that 59.99996 is no 60.
    let tenths = (deg.abs() * 600_000.0).round();
    let whole = (tenths / 600_000.0).floor();
    let minutes = (tenths - whole * 600_000.0) / 10_000.0;
    let letter = if deg < 0.0 { letters[1] } else { letters[0] };
    format!("{whole:0width$.0}{minutes:07.4},{letter}")
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
