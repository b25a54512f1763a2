//! The unscented Kalman filter on an antenna on a stepper motor, with a custom planner.
//!
//! `cargo run --example ukf_stepper_custom`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("ukf", helper::stepper(), helper::custom())
}
