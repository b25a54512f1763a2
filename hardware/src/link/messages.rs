//! Messages of a link: reports of a drone, orders to it, and views for those who look on.

use std::fmt;

use foxhunt_core::{BeaconId, Estimate, Pose, Reception, Waypoint};
use serde::{Deserialize, Serialize};

use super::{ClockOffset, Echo, UnixTime};

/// A message of a drone to the fusing end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Report {
    /// Pose of the drone; several times a second.
    Pose {
        /// Time of the pose, by the clock of the fusing node.
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
    /// End of the turn, by the clock of the fusing node. A reception's own time is not sent: it is
    /// this one, in seconds of whoever reads it.
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
    /// Ordered place; `None` without an order so far: the drone stays at its place.
    pub goal: Option<Waypoint>,
    /// True if the drone shall land at its present place.
    pub land: bool,
    /// True if one that stands ready shall take off.
    pub take_off: bool,
    /// The drone's part in the rest of the hunt.
    pub leave: Leave,
    /// The turn that is ordered.
    pub turn: Turn,
    /// The last of the drone's deliveries that the fusing node has logged; these need not be
    /// repeated.
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
    /// Beacon of the delivery.
    pub beacon: BeaconId,
    /// End of its turn.
    pub ended: UnixTime,
}

/// State of a drone, several times a second.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Status {
    /// Time of the status, by the clock of the fusing node as far as the drone knows it.
    pub at: UnixTime,
    /// Time of the status by the drone's own clock; it comes back in the order's
    /// [`Echo`](super::Echo).
    pub sent: UnixTime,
    /// Offset of the drone's clock; absent while that is not known.
    pub clock: Option<ClockOffset>,
    /// The [`number`](super::Order::number) of the order that it follows; 0 without an order.
    pub order: u64,
    /// Stage of its flight.
    pub stage: Stage,
    /// Reason why it does not follow, or fault since; empty without one.
    pub failure: String,
}

/// Stage of a drone's flight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Stage {
    /// It is on the ground, and not ready.
    Preparing,
    /// It is on the ground, and could take off.
    Ready,
    /// It takes off.
    Climbing,
    /// It is in the air and follows its orders.
    #[default]
    Flying,
    /// It takes no orders: its pilot has it, it flies by its own rules, or its link is lost.
    Away,
    /// It comes down by the pilot's rules.
    Leaving,
    /// It is down, or in its pilot's hands, and takes no part any more.
    Over,
}

impl Stage {
    /// All stages, in the order of a flight.
    pub const ALL: [Self; 7] = [
        Self::Preparing,
        Self::Ready,
        Self::Climbing,
        Self::Flying,
        Self::Away,
        Self::Leaving,
        Self::Over,
    ];
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Preparing => "is not ready",
            Self::Ready => "is ready to take off",
            Self::Climbing => "takes off",
            Self::Flying => "flies",
            Self::Away => "takes no orders",
            Self::Leaving => "leaves",
            Self::Over => "is out of the hunt",
        })
    }
}

/// State of a hunt, as the fusing node shows it to whoever looks on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct View {
    /// Time of the view.
    pub at: UnixTime,
    /// Beliefs about the beacons that are or were searched for.
    pub beacons: Vec<BeaconView>,
    /// The drones, in their order.
    pub drones: Vec<DroneView>,
    /// Health of the drones and of the hunt.
    pub health: Vec<Health>,
}

/// Belief about a beacon.
#[derive(Clone, Debug, PartialEq)]
pub struct BeaconView {
    /// Number of the beacon in the hunt's list, from 0.
    pub number: u16,
    /// Name of the beacon.
    pub name: String,
    /// Estimate of its place, East and North in metres.
    pub estimate: Estimate<2>,
}

/// Goal and path of a drone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DroneView {
    /// Ordered place.
    pub goal: Option<Waypoint>,
    /// Past poses, with their times.
    pub path: Vec<(UnixTime, Pose)>,
}

/// Health of a drone, or of the hunt.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Health {
    /// Name of it, such as `foxhunt: drone 0`.
    pub name: String,
    /// Fault; `None` if all is well.
    pub trouble: Option<String>,
    /// Activity, where nothing is wrong.
    pub doing: String,
    /// Figures and what they are.
    pub values: Vec<(String, String)>,
}
