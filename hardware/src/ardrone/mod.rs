//! The Parrot AR.Drone 2.0.

mod config;
mod control;
mod examine;
#[cfg(test)]
mod safety;
mod serve;
mod traits;
mod vehicle;

pub use config::{ArDroneConfig, ArDroneError};
pub use vehicle::ArDrone;
