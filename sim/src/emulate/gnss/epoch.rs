use chrono::{DateTime, Datelike, NaiveDateTime, Timelike};
use foxhunt_wire::{
    FixQuality,
    geodesy::{Geodetic, radians_to_compass_deg},
};
use nalgebra::Vector3;

/// The state of a receiver at one moment, before it is put into bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Epoch {
    /// UNIX time in milliseconds.
    pub(super) utc_ms: i64,
    /// Its place by its own measurement.
    pub(super) place: Geodetic,
    pub(super) quality: FixQuality,
    pub(super) sigma_m: Vector3<f64>,
    /// East, North and Up in metres per second.
    pub(super) velocity: Vector3<f64>,
    pub(super) satellites: u8,
    pub(super) hdop: f64,
    pub(super) geoid_m: f64,
}

impl Epoch {
    pub(super) fn has_fix(&self) -> bool {
        self.quality > FixQuality::None
    }

    pub(super) fn date_time(&self) -> NaiveDateTime {
        DateTime::from_timestamp_millis(self.utc_ms).unwrap_or_default().naive_utc()
    }

    /// The time as NMEA has it: hhmmss.ss.
    pub(super) fn hms(&self) -> String {
        let time = self.date_time();
        let hundredths = time.nanosecond() / 10_000_000;
        format!("{:02}{:02}{:02}.{hundredths:02}", time.hour(), time.minute(), time.second())
    }

    /// The date as NMEA has it: ddmmyy.
    pub(super) fn dmy(&self) -> String {
        let date = self.date_time();
        format!("{:02}{:02}{:02}", date.day(), date.month(), date.year().rem_euclid(100))
    }

    /// The vertical and the position's dilution, in the usual proportion to the horizontal one.
    pub(super) fn vdop_pdop(&self) -> (f64, f64) {
        let vdop = self.hdop * 1.6;
        (vdop, self.hdop.hypot(vdop))
    }

    /// Metres per second over ground, and the course in degrees clockwise from North.
    pub(super) fn speed_course(&self) -> (f64, f64) {
        let east = self.velocity.x;
        let north = self.velocity.y;
        (east.hypot(north), radians_to_compass_deg(libm::atan2(north, east)))
    }
}

/// The nearest whole number, within what fits.
#[expect(clippy::cast_possible_truncation, reason = "a float that is out of range saturates")]
pub(super) fn whole(value: f64) -> i64 {
    value.round() as i64
}
