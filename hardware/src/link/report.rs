use foxhunt_core::{BeaconId, Pose, Reception};
use serde::{Deserialize, Serialize};

use super::{Status, Taken, UnixTime};

/// A message of a drone to the fusing end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Report {
    /// Where it is; several times a second.
    Pose {
        /// When, by the clock of the one that fuses.
        at: UnixTime,
        /// Where, in the hunt's own frame.
        pose: Pose,
    },
    /// How it is; several times a second.
    Status(Status),
    /// What came of a turn; until it is taken in.
    Delivery(Box<Delivery>),
}

/// What came of a turn for one beacon.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Delivery {
    /// Of which beacon.
    pub beacon: BeaconId,
    /// When the turn ended, by the clock of the one that fuses. A reception's own time is not sent:
    /// it is this one, in seconds of whoever reads it.
    pub ended: UnixTime,
    /// What was received, or why nothing was.
    pub reception: Result<Reception, String>,
}

impl Delivery {
    /// Which one it is: no two of a drone have the same beacon and the same time.
    #[must_use]
    pub fn name(&self) -> Taken {
        Taken { beacon: self.beacon, ended: self.ended }
    }
}
