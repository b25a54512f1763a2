use foxhunt_core::{Estimate, Pose, Waypoint};
use serde::Serialize;

use super::UnixTime;

/// State of a hunt, as the one that fuses shows it to whoever looks on.
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
    /// Its number in the hunt's list, from 0.
    pub number: u16,
    /// Its name.
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
