//! The extended Kalman filter on an antenna on a stepper motor, with a custom planner.
//!
//! `cargo run --example ekf_stepper_custom`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("ekf", helper::stepper(), helper::custom())
}
