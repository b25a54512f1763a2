use foxhunt_core::{BeaconId, Sweep};
use foxhunt_sensors::{LearnedPattern, learn_pattern};
use nalgebra::Vector2;

use super::RecordedError;
use crate::recording::Recording;

/// Source of a transmitter's true direction, turn by turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KnownDirection {
    /// From the place that the recording has.
    Recorded,
    /// From its place, East and North in metres.
    Place(Vector2<f64>),
    /// It was the same for all turns: radians counter-clockwise from East.
    Bearing(f64),
}

/// Learns an antenna's pattern from all recorded turns of one beacon, with `positions` to a turn.
///
/// # Errors
///
/// [`RecordedError`] names the file and line where the direction is not known, or why nothing can
/// be learned.
pub fn learn_antenna(
    recordings: &[Recording],
    beacon: Option<&str>,
    known: KnownDirection,
    positions: u16,
) -> Result<LearnedPattern, RecordedError> {
    let mut turns = Vec::new();
    let mut bearings = Vec::new();
    for recording in recordings {
        let sweeps = recording.sweeps(positions)?.into_iter();
        for sweep in sweeps.filter(|sweep| sweep.beacon_name.as_deref() == beacon) {
            let from = sweep.located.then(|| sweep.sweep.receiver.position.xy());
            let towards = |place: Vector2<f64>| {
                let way = place - from?;
                (way.norm() > f64::MIN_POSITIVE).then(|| libm::atan2(way.y, way.x))
            };
            let begins = || {
                let mut records = recording.records().iter();
                records.find(|r| r.line == sweep.line && r.beacon.as_deref() == beacon)
            };
            let bearing = match known {
                KnownDirection::Recorded => {
                    begins().and_then(|record| record.truth).and_then(towards)
                }
                KnownDirection::Place(place) => towards(place),
                KnownDirection::Bearing(bearing) => Some(bearing),
            };
            let file = recording.file().to_owned();
            let line = sweep.line;
            bearings.push(bearing.ok_or(RecordedError::NoTruth { file, line })?);
            turns.push(sweep);
        }
    }
    let file = || recordings.iter().map(Recording::file).collect::<Vec<_>>().join(", ");
    if turns.is_empty() {
        return Err(RecordedError::NoTurns { file: file() });
    }
    let turns: Vec<(Sweep<'_>, f64)> =
        turns.iter().map(|sweep| sweep.as_sweep(BeaconId(0))).zip(bearings).collect();
    learn_pattern(&turns).map_err(|source| RecordedError::Antenna { file: file(), source })
}
