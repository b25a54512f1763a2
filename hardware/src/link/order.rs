use foxhunt_core::{BeaconId, Waypoint};
use serde::{Deserialize, Serialize};

use super::{Echo, UnixTime};

/// All that a drone is to do, repeated several times a second: a drone that missed some, or has
/// just begun, knows everything from the next one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Order {
    /// Time at which it was sent.
    pub at: UnixTime,
    /// Number that is larger for every order with another content, so that one that comes late is
    /// known; 0 stands for no order.
    pub number: u64,
    /// Ordered place; `None` without an order so far: the drone stays where it is.
    pub goal: Option<Waypoint>,
    /// True if it shall land where it is.
    pub land: bool,
    /// True if one that stands ready shall take off.
    pub take_off: bool,
    /// The drone's part in the rest of the hunt.
    pub leave: Leave,
    /// The turn that is ordered.
    pub turn: Turn,
    /// The last of its deliveries that are safe with the one that fuses, and need not be repeated.
    pub taken: Vec<Taken>,
    /// The last of its statuses that was received: for its clock.
    pub echo: Option<Echo>,
}

/// A drone's part in the rest of the hunt: it goes on, or comes down by one of the pilot's rules.
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
    /// Number that is larger for every turn, so that each is made once; 0 stands for no turn.
    pub number: u64,
    /// Beacons to listen for, without the delivered ones.
    pub beacons: Vec<BeaconId>,
}

/// Name of a delivery that was taken in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Taken {
    /// Its beacon.
    pub beacon: BeaconId,
    /// End of its turn.
    pub ended: UnixTime,
}
