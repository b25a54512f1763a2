//! The particle filter on an antenna on a stepper motor, with a custom planner.
//!
//! `cargo run --example particle_stepper_custom`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("particle", helper::stepper(), helper::custom())
}
