//! ArduPilot and PX4 over MAVLink 2.

mod authority;
mod camera;
mod config;
mod cruise;
mod doubt;
mod drift;
mod error;
mod examine;
mod failsafes;
mod fence_query;
mod flight;
mod goal;
mod ground;
mod hindrance;
mod limits;
mod link;
mod orders;
mod own_fence;
mod parameter;
mod phase;
mod quality;
#[cfg(test)]
mod safety;
mod setpoint;
mod streams;
mod take_off;
mod telemetry;
mod texts;
mod timed;
mod vehicle;

pub use config::{MavlinkConfig, MavlinkOrigin, MavlinkSigning, PositionRequirements};
pub use error::MavlinkError;
pub use limits::FlightLimits;
pub use telemetry::RadioStatus;
pub use vehicle::MavlinkVehicle;
