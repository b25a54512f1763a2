use foxhunt_sensors::{AntennaError, ParameterError};

/// Why a world, or something asked of it, is refused. What was asked for did not happen.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// A number in the configuration is out of its range.
    #[error("{field} is {value}; it must be {requirement}")]
    Field {
        /// Where it stands in the configuration.
        field: String,
        /// What it held.
        value: f64,
        /// What it must be.
        requirement: &'static str,
    },
    /// There is no such antenna.
    #[error("channel.antenna: {0}")]
    Antenna(#[from] AntennaError),
    /// The law of propagation is out of its range.
    #[error("channel.path_loss: {0}")]
    PathLoss(#[source] ParameterError),
    /// A source cannot be made as it is asked for.
    #[error("the source: {0}")]
    Source(#[source] ParameterError),
    /// There is no such drone.
    #[error("there is no drone {drone}; the world has {drones}, counted from 0")]
    Drone {
        /// Which one was asked for.
        drone: usize,
        /// How many there are.
        drones: usize,
    },
    /// A place on Earth that is none.
    #[cfg(feature = "emulators")]
    #[error("the origin: {0}")]
    Place(#[from] foxhunt_wire::geodesy::GeodesyError),
    /// The autopilot has no such mode.
    #[cfg(feature = "emulators")]
    #[error("there is no mode {mode:?}")]
    FlightMode {
        /// What it was called.
        mode: String,
    },
    /// There is no link to the drone at present.
    #[error("there is no link")]
    Link {
        /// Which one.
        drone: usize,
    },
    /// There is no such beacon.
    #[error("there is no beacon {beacon}; the world has {beacons}, counted from 0")]
    Beacon {
        /// Which one was asked for.
        beacon: u16,
        /// How many there are.
        beacons: usize,
    },
    /// Time cannot pass so.
    #[error("a time step of {dt} s; it must be finite and not negative")]
    TimeStep {
        /// The step in seconds.
        dt: f64,
    },
    /// The rotator was ordered to no angle.
    #[error("the rotator was ordered to {angle} rad; it must be finite")]
    Angle {
        /// The order in radians.
        angle: f64,
    },
    /// The drone was ordered to turn at no rate.
    #[error("the drone was ordered to turn at {rate} rad/s; it must be finite")]
    SpinRate {
        /// The order in radians per second.
        rate: f64,
    },
    /// The goal is no place, or too far away to compute with.
    #[error("the goal ({east}, {north}, {up}) m is not at a finite distance")]
    Goal {
        /// Its East in metres.
        east: f64,
        /// Its North in metres.
        north: f64,
        /// Its height in metres.
        up: f64,
    },
}
