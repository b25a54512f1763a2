//! The extended Kalman filter on a body that turns, with a custom planner.
//!
//! `cargo run --example ekf_body_custom`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("ekf", helper::rotating_body(), helper::custom())
}
