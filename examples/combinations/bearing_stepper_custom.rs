//! Bearings alone on an antenna on a stepper motor, with a planner of one's own.
//!
//! `cargo run --example bearing_stepper_custom`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("particle-bearing", helper::stepper(), helper::custom())
}
