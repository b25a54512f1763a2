//! Reasons why a world, a terrain or a request is refused.

use foxhunt_core::parameter::FieldError;
use foxhunt_sensors::{AntennaError, ParameterError};

/// The reason why a world, or a request to it, is refused. What was requested did not happen.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// A number in the configuration is out of its range.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// There is no such antenna.
    #[error("channel.antenna: {0}")]
    Antenna(#[from] AntennaError),
    /// The law of propagation is out of its range.
    #[error("channel.path_loss: {0}")]
    PathLoss(#[source] ParameterError),
    /// There is no such terrain.
    #[error("terrain: {0}")]
    Terrain(#[source] ReliefError),
    /// A source cannot be made as it is requested.
    #[error("the source: {0}")]
    Source(#[source] ParameterError),
    /// There is no such drone.
    #[error("there is no drone {drone}; the world has {drones}, counted from 0")]
    Drone {
        /// The drone that was requested.
        drone: usize,
        /// The number of drones.
        drones: usize,
    },
    /// The origin is not a valid place on Earth.
    #[cfg(feature = "emulators")]
    #[error("the origin: {0}")]
    Place(#[from] foxhunt_wire::geodesy::GeodesyError),
    /// The autopilot has no such mode.
    #[cfg(feature = "emulators")]
    #[error("there is no mode {mode:?}")]
    FlightMode {
        /// The mode's name as requested.
        mode: String,
    },
    /// An emulated autopilot has no parameter of this name.
    #[cfg(feature = "emulators")]
    #[error("there is no parameter {name:?}")]
    Parameter {
        /// Name of the parameter.
        name: String,
    },
    /// A drone was put at a pose with numbers that are not finite.
    #[cfg(feature = "emulators")]
    #[error("drone {drone} was put at a pose that is not finite")]
    Pose {
        /// The drone.
        drone: usize,
    },
    /// There is no link to the drone at present.
    #[error("there is no link")]
    Link {
        /// The drone.
        drone: usize,
    },
    /// There is no such beacon.
    #[error("there is no beacon {beacon}; the world has {beacons}, counted from 0")]
    Beacon {
        /// The beacon that was requested.
        beacon: u16,
        /// The number of beacons.
        beacons: usize,
    },
    /// Time cannot pass so.
    #[error("a time step of {dt} s; it must be finite and not negative")]
    TimeStep {
        /// The step in seconds.
        dt: f64,
    },
    /// A direction that the antenna cannot be turned to.
    #[error("the antenna was turned to {angle} rad; it must be finite")]
    Angle {
        /// The direction in radians.
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
        /// East of the goal in metres.
        east: f64,
        /// North of the goal in metres.
        north: f64,
        /// Height of the goal in metres.
        up: f64,
    },
}

/// The reason why there is no terrain.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReliefError {
    /// A number is out of its range, or a field missing or not used.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// The tiles cannot be read, or do not cover the reach.
    #[error("{reason}")]
    Tiles {
        /// The problem, with the tile and the place.
        reason: String,
    },
}
