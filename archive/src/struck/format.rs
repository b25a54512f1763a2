use foxhunt_core::{BeaconId, Reception};
use serde::{Deserialize, Serialize};

/// Version of the file that this program writes and reads.
pub const STRUCK_VERSION: u32 = 1;

/// Identifies a reception.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum ReceptionKey {
    /// In a log.
    Logged(ReceptionId),
    /// In a recording.
    Recorded(RowId),
}

/// Identifies a reception of a log.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReceptionId {
    /// Index of the drone, from 0.
    pub drone: usize,
    /// The beacon.
    pub beacon: BeaconId,
    /// Time of the reception, in seconds; every bit counts.
    pub time: f64,
}

impl ReceptionId {
    /// Identifies a drone's reception.
    #[must_use]
    pub fn new(drone: usize, reception: &Reception) -> Self {
        Self { drone, beacon: reception.beacon, time: reception.time }
    }

    /// Drone, beacon and the bits of the time, where −0 is 0.
    pub(super) fn key(self) -> Key {
        (self.drone, self.beacon, (self.time + 0.0).to_bits())
    }
}

impl std::fmt::Display for ReceptionId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { drone, beacon, time } = self;
        write!(f, "drone {drone}, beacon {}, time {time}", beacon.0)
    }
}

pub(super) type Key = (usize, BeaconId, u64);

/// Identifies a reception of a recording.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RowId {
    /// The name of the file, without its folder unless another one of the same name is read along.
    pub file: String,
    /// The line of the row, or of the first one of the turn, from 1.
    pub line: u64,
    /// The beacon, where the recording names beacons.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beacon: Option<String>,
}

impl std::fmt::Display for RowId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { file, line, beacon } = self;
        match beacon {
            Some(beacon) => write!(f, "{beacon} in line {line} of {file}"),
            None => write!(f, "line {line} of {file}"),
        }
    }
}
