use foxhunt_core::{BeaconId, Waypoint};
use serde::{Deserialize, Serialize};

use super::UnixTime;

/// All that a drone is to do, said again several times a second: a drone that missed some, or has
/// just begun, knows everything from the next one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Order {
    /// When it was said.
    pub at: UnixTime,
    /// Larger for every order that says something else, so that one that comes late is known; 0 is
    /// none.
    pub number: u64,
    /// Where it shall be; where it is, if nobody has said so yet.
    pub goal: Option<Waypoint>,
    /// Whether it shall land where it is.
    pub land: bool,
    /// The turn that it is asked for.
    pub turn: Turn,
    /// The last of its deliveries that are safe with the one that fuses, and need not be said again.
    pub taken: Vec<Taken>,
}

/// A turn of the antenna that is asked for.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Turn {
    /// Larger for every turn, so that each is made once; 0 is none.
    pub number: u64,
    /// Whom to listen for, those that were delivered left out.
    pub beacons: Vec<BeaconId>,
}

/// Which delivery was taken in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Taken {
    /// Of which beacon.
    pub beacon: BeaconId,
    /// When the turn ended.
    pub ended: UnixTime,
}
