use foxhunt_core::{BeaconId, BearingExtractor, Reading};

use super::RecordedError;
use crate::recording::{RecordedSweep, Recording};

/// A bearing whose confidence is below this should not be relied on.
///
/// The confidence is the mean resultant length of the power over the turn, times the share of the
/// circle that was received; of a clean patch antenna it is 0.8, of a flat pattern 0.
pub const LOW_CONFIDENCE: f64 = 0.6;

/// An extractor's result for a recorded turn.
#[derive(Clone, Debug, PartialEq)]
pub struct BearingReading {
    /// The turn.
    pub sweep: RecordedSweep,
    /// Level of the turn, and its bearing or the reason that the bearing is missing.
    pub reading: Reading,
}

impl BearingReading {
    /// Returns true if the turn has a bearing that is not to be relied on.
    #[must_use]
    pub fn is_low(&self) -> bool {
        self.reading.bearing.is_ok_and(|bearing| bearing.confidence < LOW_CONFIDENCE)
    }
}

/// Extracts the level and bearing of every turn of a recording, of `positions` positions each.
///
/// # Errors
///
/// [`RecordedError`] when there is no turn, or one cannot be read.
pub fn bearings(
    recording: &Recording,
    extractor: &dyn BearingExtractor,
    positions: u16,
) -> Result<Vec<BearingReading>, RecordedError> {
    let sweeps = recording.sweeps(positions)?;
    if sweeps.is_empty() {
        return Err(RecordedError::NoTurns { file: recording.file().to_owned() });
    }
    sweeps
        .into_iter()
        .map(|sweep| {
            let reading = extractor.extract(&sweep.as_sweep(BeaconId(0))).map_err(|source| {
                RecordedError::Turn { file: recording.file().to_owned(), line: sweep.line, source }
            })?;
            Ok(BearingReading { sweep, reading })
        })
        .collect()
}
