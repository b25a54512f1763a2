//! Bearings alone on an antenna on a stepper motor, with a custom planner.
//!
//! `cargo run --example bearing_stepper_custom`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("particle-bearing", helper::stepper(), helper::custom())
}
