use std::io;

use foxhunt_sim::SimError;
use foxhunt_wire::geodesy::GeodesyError;

use super::CarriedDroneError;

/// Reason why a field cannot be emulated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EmulatedFieldError {
    /// A port cannot be had.
    #[error(transparent)]
    Open(#[from] io::Error),
    /// There are no more ports.
    #[error("there is no UDP port for drone {drone}, counted from 0, after {first}")]
    Port {
        /// The first one.
        first: u16,
        /// Index of the drone, from 0.
        drone: usize,
    },
    /// A number is out of its range.
    #[error(transparent)]
    Device(#[from] SimError),
    /// There is no emulated device of this kind.
    #[error(
        "drone {drone}, counted from 0: no emulated device is a source of kind \"{kind}\"; \
         foxhunt hunt SCENARIO flies it in a simulated world without devices"
    )]
    Source {
        /// Index of the drone, from 0.
        drone: usize,
        /// The kind of its source.
        kind: &'static str,
    },
    /// A vehicle of another program cannot be followed.
    #[error(transparent)]
    Carried(#[from] CarriedDroneError),
    /// A vehicle of another program keeps the time of the wall.
    #[error(
        "vehicles[{drone}]: fly --emulate keeps a time of its own, which another program's vehicle \
         does not; emulate field goes with the clock on the wall"
    )]
    Foreign {
        /// Index of the vehicle's drone, from 0.
        drone: usize,
    },
    /// There are more vehicles than drones.
    #[error("there are {vehicles} vehicles for {drones} drones")]
    Vehicles {
        /// Number of vehicles.
        vehicles: usize,
        /// Number of drones.
        drones: usize,
    },
    /// The beacons do not all pulse alike, so that no one receiver is set for them.
    #[error(
        "beacon {beacon}, counted from 0: a field with tags that pulse has tags alone, with pulses \
         of {pulse_s} s each"
    )]
    Pulses {
        /// The first that is otherwise.
        beacon: usize,
        /// Pulse length of the first tag, in seconds.
        pulse_s: f64,
    },
    /// The site is not where the world's tiles have their origin.
    #[error(
        "site: world.terrain of the scenario has its origin at {lat_deg}°, {lon_deg}°; leave the \
         site out, or give that"
    )]
    Origin {
        /// Latitude of the tiles' origin in degrees.
        lat_deg: f64,
        /// Longitude.
        lon_deg: f64,
    },
    /// The site is no place.
    #[error("site: {0}")]
    Site(#[from] GeodesyError),
}
