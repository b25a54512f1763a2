use foxhunt_core::{BeaconId, Pose, Reception};
use serde::{Deserialize, Serialize};

use super::{Status, Taken, UnixTime};

/// A message of a drone to the fusing end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Report {
    /// Pose of the drone; several times a second.
    Pose {
        /// Time of the pose, by the clock of the one that fuses.
        at: UnixTime,
        /// The pose, in the hunt's own frame.
        pose: Pose,
    },
    /// State of the drone; several times a second.
    Status(Status),
    /// Outcome of a turn; until it is taken in.
    Delivery(Box<Delivery>),
}

/// Outcome of a turn for one beacon.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Delivery {
    /// The beacon.
    pub beacon: BeaconId,
    /// End of the turn, by the clock of the one that fuses. A reception's own time is not sent: it
    /// is this one, in seconds of whoever reads it.
    pub ended: UnixTime,
    /// The reception, or why nothing was received.
    pub reception: Result<Reception, String>,
}

impl Delivery {
    /// Returns its name: no two of a drone have the same beacon and the same time.
    #[must_use]
    pub fn name(&self) -> Taken {
        Taken { beacon: self.beacon, ended: self.ended }
    }
}
