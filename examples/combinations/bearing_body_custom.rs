//! Bearings alone on a body that turns, with a custom planner.
//!
//! `cargo run --example bearing_body_custom`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("particle-bearing", helper::rotating_body(), helper::custom())
}
