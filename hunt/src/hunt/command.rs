use foxhunt_core::{BeaconId, Waypoint};

/// An order of the hunt, for the owner of the devices to carry out.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Send a drone somewhere.
    GoTo {
        /// Which drone.
        drone: usize,
        /// Where to.
        goal: Waypoint,
    },
    /// Land a drone where it is.
    Land {
        /// Which drone.
        drone: usize,
    },
    /// Turn the antenna of a drone and listen for beacons.
    Listen {
        /// Which drone.
        drone: usize,
        /// For which beacons, all in the same turn.
        beacons: Vec<BeaconId>,
    },
}
