//! The antenna's stepper behind Firmata.

mod coils;
mod config;
mod driver;
mod error;
mod examine;
mod gearing;
mod homing;
mod leg;
mod levels;
mod link;
mod moving;
mod phase;
mod setup;
#[cfg(test)]
mod tests;

pub use config::{Approach, BeyondCable, FirmataConfig, Homing};
pub use driver::FirmataStepper;
pub use error::{CoilFailure, FirmataStepperError, LostPosition, MissingStepper};
