//! An autopilot that flies a drone of the world, as ArduCopter or PX4 would.

mod brain;
mod commands;
mod config;
mod emulated;
mod flight;
mod params;
mod streams;
mod telemetry;
mod yaw;

pub use config::{AutopilotConfig, AutopilotFaults, FailsafeOrder, GpsStep, PilotOrder};
pub use emulated::EmulatedAutopilot;
