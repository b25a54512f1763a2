use foxhunt_core::{BeaconId, Waypoint};

/// An order of the hunt, for the owner of the devices to carry out.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Send a drone somewhere.
    GoTo {
        /// Index of the drone.
        drone: usize,
        /// Place to fly to.
        goal: Waypoint,
    },
    /// Land a drone where it is.
    Land {
        /// Index of the drone.
        drone: usize,
    },
    /// Turn the antenna of a drone and listen for beacons.
    Listen {
        /// Index of the drone.
        drone: usize,
        /// The beacons, all in the same turn.
        beacons: Vec<BeaconId>,
    },
}
