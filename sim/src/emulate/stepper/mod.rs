//! A Firmata Arduino with the stepper of a drone's antenna.

mod config;
mod device;
mod gear;
mod motor;

pub use config::{EmulatedStepperConfig, EmulatedSwitch};
pub use device::EmulatedStepper;
