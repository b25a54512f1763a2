use foxhunt_core::{Estimate, Pose, Waypoint};
use serde::Serialize;

use super::UnixTime;

/// What the one that fuses shows to whoever looks on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct View {
    /// When.
    pub at: UnixTime,
    /// What is believed of the beacons that are or were searched for.
    pub beacons: Vec<BeaconView>,
    /// The drones, in their order.
    pub drones: Vec<DroneView>,
    /// How everyone is.
    pub health: Vec<Health>,
}

/// What is believed of a beacon.
#[derive(Clone, Debug, PartialEq)]
pub struct BeaconView {
    /// Its number in the hunt's list, from 0.
    pub number: u16,
    /// Its name.
    pub name: String,
    /// Where it is believed to be, East and North in metres.
    pub estimate: Estimate<2>,
}

/// What a drone does.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DroneView {
    /// Where it shall be.
    pub goal: Option<Waypoint>,
    /// Where it has been, and when.
    pub path: Vec<(UnixTime, Pose)>,
}

/// How a drone, or the hunt, is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Health {
    /// Who, such as `foxhunt: drone 0`.
    pub name: String,
    /// What is wrong; `None` if nothing is.
    pub trouble: Option<String>,
    /// What it does, where nothing is wrong.
    pub doing: String,
    /// Figures and what they are.
    pub values: Vec<(String, String)>,
}
