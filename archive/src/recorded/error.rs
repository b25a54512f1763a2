use foxhunt_core::{NoReading, ObservationError};
use foxhunt_sensors::{CalibrationError, LearnPatternError};

use crate::recording::{RecordingError, near_miss::did_you_mean};

/// This many names are listed; of more the rest is counted.
const LISTED: usize = 100;

fn list(names: &[String]) -> String {
    let listed = names.iter().take(LISTED).cloned().collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(LISTED) {
        0 => listed,
        more => format!("{listed} and {more} more"),
    }
}

/// Error in using a recording. Each names the file, and the line where there is one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordedError {
    /// The turns of the recording cannot be put together.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The recording has no place of the receiver.
    #[error("{file}, line {line}: there is no position; {advice}")]
    NoPlace {
        /// The file.
        file: String,
        /// The first such line.
        line: u64,
        /// The columns or files that would give a place.
        advice: String,
    },
    /// A row is no observation.
    #[error("{file}, line {line}: {source}")]
    Observation {
        /// The file.
        file: String,
        /// The line.
        line: u64,
        /// Cause of the error.
        source: ObservationError,
    },
    /// A turn cannot be read at all.
    #[error("{file}, the turn that begins in line {line}: {source}")]
    Turn {
        /// The file.
        file: String,
        /// The line.
        line: u64,
        /// Cause of the error.
        source: NoReading,
    },
    /// The recording has no turns of a directional antenna.
    #[error(
        "{file}: there is no turn of an antenna; a bearing needs rss_dbm and \
         boresight_deg_compass, or antenna_deg and heading_deg_compass"
    )]
    NoTurns {
        /// The file.
        file: String,
    },
    /// The recordings are not of a station with fixed antennas.
    #[error(
        "{file}: this is no station of fixed antennas: that has 1 to 16 boresights, each of which \
         comes again and again"
    )]
    NoStation {
        /// The first file.
        file: String,
    },
    /// The recording holds several beacons, and none is chosen.
    #[error("the recording holds {}; choose one with --beacon", list(beacons))]
    SeveralBeacons {
        /// Names of the beacons in the recording.
        beacons: Vec<String>,
    },
    /// The chosen beacon is not in the recording.
    #[error(
        "no row belongs to beacon {wanted:?}{}; the recording holds {}",
        did_you_mean(wanted, beacons.iter().map(String::as_str)),
        list(beacons)
    )]
    NoSuchBeacon {
        /// The chosen one.
        wanted: String,
        /// The names there are.
        beacons: Vec<String>,
    },
    /// The place of the transmitter must be known for this.
    #[error(
        "{file}, line {line}: the distance is not known; give the transmitter's place with --truth"
    )]
    NoTruth {
        /// The file.
        file: String,
        /// The first such line.
        line: u64,
    },
    /// A row is no point of range and power.
    #[error("{file}, line {line}: {source}")]
    Point {
        /// The file.
        file: String,
        /// The line.
        line: u64,
        /// Cause of the error.
        source: CalibrationError,
    },
    /// No pattern can be learned from the turns.
    #[error("{file}: {source}")]
    Antenna {
        /// The files.
        file: String,
        /// Cause of the error.
        source: LearnPatternError,
    },
    /// The law cannot be fitted.
    #[error("{file}: {source}")]
    Calibration {
        /// The file.
        file: String,
        /// Cause of the error.
        source: CalibrationError,
    },
}
