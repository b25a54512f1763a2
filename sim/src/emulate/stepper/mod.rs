//! A Firmata Arduino with the stepper of a drone's antenna.

mod config;
mod device;
mod gear;
mod motor;
mod parser;
mod pins;
mod wires;

pub use config::{EmulatedStepperConfig, EmulatedSwitch};
pub use device::EmulatedStepper;
