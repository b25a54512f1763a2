//! Logs of autopilots and GNSS receivers, as far as they hold places and levels over time.

mod dataflash;
mod log;
mod receivers;
mod tlog;
mod ulog;

use foxhunt_wire::geodesy::Geodetic;

pub(super) use log::{Fix, Levels, Log};

/// Kind of a log, by its first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// `ArduPilot`'s dataflash log, binary.
    Dataflash,
    /// `ArduPilot`'s log as text.
    DataflashText,
    /// PX4's log.
    Ulog,
    /// MAVLink messages as a ground station received them.
    Tlog,
    /// Sentences of NMEA 0183 as a GNSS receiver sends them.
    Nmea,
    /// Lines of Google's GNSS Logger for Android.
    GnssLogger,
}

impl Kind {
    /// The kind of a log; `None` for any other file.
    pub(super) fn of(bytes: &[u8]) -> Option<Self> {
        match bytes {
            [0xa3, 0x95, ..] => Some(Self::Dataflash),
            [b'F', b'M', b'T', b',', ..] => Some(Self::DataflashText),
            [b'U', b'L', b'o', b'g', 0x01, 0x12, 0x35, ..] => Some(Self::Ulog),
            _ if tlog::is_tlog(bytes) => Some(Self::Tlog),
            _ if receivers::is_nmea(bytes) => Some(Self::Nmea),
            _ => receivers::is_gnss_logger(bytes).then_some(Self::GnssLogger),
        }
    }

    /// The name that messages give to the log.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Dataflash | Self::DataflashText => "an ArduPilot log",
            Self::Ulog => "a PX4 log",
            Self::Tlog => "a MAVLink log",
            Self::Nmea => "an NMEA log",
            Self::GnssLogger => "a log of Android's GNSS Logger",
        }
    }

    /// Reads the places in the order of time.
    ///
    /// # Errors
    ///
    /// The reason why there are no places, as the end of a sentence that begins with the file.
    pub(super) fn fixes(self, bytes: &[u8]) -> Result<Vec<Fix>, String> {
        Ok(self.log(bytes)?.fixes)
    }

    /// Reads places and levels in the order of time.
    ///
    /// # Errors
    ///
    /// As [`fixes`](Self::fixes).
    pub(super) fn log(self, bytes: &[u8]) -> Result<Log, String> {
        let Log { mut fixes, levels } = match self {
            Self::Dataflash => dataflash::binary(bytes)?,
            Self::DataflashText => dataflash::text(bytes)?,
            Self::Ulog => ulog::read(bytes)?,
            Self::Tlog => tlog::read(bytes)?,
            Self::Nmea => receivers::read_nmea(bytes)?,
            Self::GnssLogger => receivers::read_gnss_logger(bytes)?,
        };
        fixes.retain(|fix| fix.time.is_finite() && is_place(&fix.place));
        fixes.sort_by(|a, b| a.time.total_cmp(&b.time));
        fixes.dedup_by(|next, last| next.time <= last.time);
        if fixes.is_empty() {
            return Err("it holds no place; had the vehicle a fix of its GNSS?".to_owned());
        }
        Ok(Log { fixes, levels })
    }
}

/// Returns true for a place in range that is not the one of a receiver without a fix.
fn is_place(place: &Geodetic) -> bool {
    let is_origin = place.lat_deg.abs() < 1e-6 && place.lon_deg.abs() < 1e-6;
    place.lat_deg.abs() <= 90.0
        && place.lon_deg.abs() <= 360.0
        && !is_origin
        && place.alt_m.is_finite()
}
