use foxhunt_core::{BeaconId, Waypoint};
use serde::{Deserialize, Serialize};

use super::{Echo, UnixTime};

/// All that a drone is to do, repeated several times a second: a drone that missed some, or has
/// just begun, knows everything from the next one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Order {
    /// When it was sent.
    pub at: UnixTime,
    /// Larger for every order with another content, so that one that comes late is known; 0 is
    /// none.
    pub number: u64,
    /// Where it shall be; where it is, without an order so far.
    pub goal: Option<Waypoint>,
    /// Whether it shall land where it is.
    pub land: bool,
    /// Whether one that stands ready shall take off.
    pub take_off: bool,
    /// Whether the hunt goes on for it.
    pub leave: Leave,
    /// The turn that is ordered.
    pub turn: Turn,
    /// The last of its deliveries that are safe with the one that fuses, and need not be repeated.
    pub taken: Vec<Taken>,
    /// The last of its statuses that was received: for its clock.
    pub echo: Option<Echo>,
}

/// Whether a drone goes on with the hunt, or by which of the pilot's rules it comes down.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Leave {
    /// It goes on.
    #[default]
    Not,
    /// The hunt is over.
    AtEnd,
    /// The hunt was broken off.
    OnAbort,
}

/// A turn of the antenna that is ordered.
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
