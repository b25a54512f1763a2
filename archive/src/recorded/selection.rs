//! Choice of a beacon in recordings, its true places, and the errors in the use of recordings.

use foxhunt_core::{NoReading, ObservationError};
use foxhunt_sensors::{CalibrationError, LearnPatternError};
use nalgebra::Vector2;

use crate::recording::{Recording, RecordingError, near_miss::did_you_mean, poses::surrounding};

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

/// The choice of a beacon in a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Selection {
    /// The only one there is.
    #[default]
    Only,
    /// The one of this name.
    Named(String),
}

/// The name of the beacon that is meant in these recordings; `None` for a nameless one.
///
/// # Errors
///
/// [`RecordedError`] when there are several and none is named, or the named one is missing.
pub fn only_beacon(
    recordings: &[Recording],
    selection: &Selection,
) -> Result<Option<String>, RecordedError> {
    let mut recorded: Vec<Option<String>> = Vec::new();
    for name in recordings.iter().flat_map(Recording::beacons) {
        let name = name.map(str::to_owned);
        if !recorded.contains(&name) {
            recorded.push(name);
        }
    }
    let beacons = || {
        let names =
            recorded.iter().map(|name| name.clone().unwrap_or_else(|| "(no name)".to_owned()));
        names.collect::<Vec<_>>()
    };
    match selection {
        Selection::Named(wanted) if recorded.contains(&Some(wanted.clone())) => {
            Ok(Some(wanted.clone()))
        }
        Selection::Named(wanted) => {
            Err(RecordedError::NoSuchBeacon { wanted: wanted.clone(), beacons: beacons() })
        }
        Selection::Only if recorded.len() > 1 => {
            Err(RecordedError::SeveralBeacons { beacons: beacons() })
        }
        Selection::Only => Ok(recorded.pop().flatten()),
    }
}

/// Returns the true place of a beacon, if the recordings have it and it stayed there: East and
/// North in metres.
#[must_use]
pub fn recorded_truth(recordings: &[Recording], beacon: Option<&str>) -> Option<Vector2<f64>> {
    /// A truth that moves by more than this, in metres, is no single place.
    const STILL: f64 = 0.5;
    let records = recordings.iter().flat_map(Recording::records);
    let of_beacon = records.filter(|record| record.beacon.as_deref() == beacon);
    let mut truths = of_beacon.map(|record| record.truth);
    let first = truths.next()??;
    truths.all(|truth| truth.is_some_and(|t| (t - first).norm() < STILL)).then_some(first)
}

/// Returns the true places of a beacon at the times of its records, in their order: seconds, and
/// East and North in metres.
#[must_use]
pub fn recorded_way(recordings: &[Recording], beacon: Option<&str>) -> Vec<(f64, Vector2<f64>)> {
    let records = recordings.iter().flat_map(Recording::records);
    let of_beacon = records.filter(|record| record.beacon.as_deref() == beacon);
    let mut way: Vec<_> = of_beacon.filter_map(|record| record.time.zip(record.truth)).collect();
    way.sort_by(|a, b| a.0.total_cmp(&b.0));
    way
}

/// Interpolates the true place of a beacon at a time between the two truths about it; `None` where
/// they are more than `gap_s` apart, or one is missing.
#[must_use]
pub fn truth_at(way: &[(f64, Vector2<f64>)], time: f64, gap_s: f64) -> Option<Vector2<f64>> {
    surrounding(way, time, gap_s).map(|(from, to, share)| from.lerp(to, share))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_truth_lies_between_its_neighbours() {
        let way = [(10.0, Vector2::new(0.0, 0.0)), (20.0, Vector2::new(4.0, -8.0))];
        assert_eq!(truth_at(&way, 10.0, 60.0), Some(Vector2::zeros()));
        assert_eq!(truth_at(&way, 12.5, 60.0), Some(Vector2::new(1.0, -2.0)));
        assert_eq!(truth_at(&way, 12.5, 9.0), None, "too far apart");
        assert_eq!(truth_at(&way, 9.9, 60.0), None, "before the first");
        assert_eq!(truth_at(&way, 20.1, 60.0), None, "after the last");
    }
}
