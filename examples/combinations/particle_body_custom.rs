//! The particle filter on a body that turns, with a planner of one's own.
//!
//! `cargo run --example particle_body_custom`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("particle", helper::rotating_body(), helper::custom())
}
