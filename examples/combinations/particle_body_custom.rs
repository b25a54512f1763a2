//! The particle filter on a body that turns, with a custom planner.
//!
//! `cargo run --example particle_body_custom`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("particle", helper::rotating_body(), helper::custom())
}
