use foxhunt_core::BeaconId;

/// What the hunt wants done by those who own the devices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Command {
    /// Send every drone to its station's goal.
    GoTo,
    /// Turn the antenna of a drone and listen for beacons.
    Listen {
        /// Which drone.
        drone: usize,
        /// For which beacons, all in the same turn.
        beacons: Vec<BeaconId>,
    },
}
