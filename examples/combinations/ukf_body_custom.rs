//! The unscented Kalman filter on a body that turns, with a custom planner.
//!
//! `cargo run --example ukf_body_custom`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("ukf", helper::rotating_body(), helper::custom())
}
