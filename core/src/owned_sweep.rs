use alloc::vec::Vec;

use nalgebra::Vector3;

use crate::{BeaconId, MeasuredList, Pose, Sample, Sweep, Unanswered};

/// A [`Sweep`] that owns its samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OwnedSweep {
    /// The beacon that was listened for.
    pub beacon: BeaconId,
    /// The time of the turn's end, in seconds.
    pub time: f64,
    /// The receiver's pose: the mean over the turn.
    pub receiver: Pose,
    /// Number of equal positions in a turn.
    pub positions: u16,
    /// The readings, in the order in which they were taken.
    pub samples: Vec<Sample>,
    /// The questions that are known to have stayed without an answer.
    pub unanswered: Vec<Unanswered>,
    /// The weakest reading that the receiver reports, in dBm, where that is known.
    pub floor_dbm: Option<f64>,
    /// σ of the receiver's East, North and Up in metres, where that is known.
    pub receiver_sigma_m: Option<Vector3<f64>>,
    /// Values measured besides power along boresights.
    pub measured: MeasuredList,
}

impl OwnedSweep {
    /// The sweep, lent.
    #[must_use]
    pub fn as_sweep(&self) -> Sweep<'_> {
        Sweep {
            beacon: self.beacon,
            time: self.time,
            receiver: self.receiver,
            positions: self.positions,
            samples: &self.samples,
            unanswered: &self.unanswered,
            floor_dbm: self.floor_dbm,
            receiver_sigma_m: self.receiver_sigma_m,
            measured: self.measured,
        }
    }
}

impl From<&Sweep<'_>> for OwnedSweep {
    fn from(sweep: &Sweep<'_>) -> Self {
        Self {
            beacon: sweep.beacon,
            time: sweep.time,
            receiver: sweep.receiver,
            positions: sweep.positions,
            samples: sweep.samples.to_vec(),
            unanswered: sweep.unanswered.to_vec(),
            floor_dbm: sweep.floor_dbm,
            receiver_sigma_m: sweep.receiver_sigma_m,
            measured: sweep.measured,
        }
    }
}
