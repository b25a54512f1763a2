//! The particle filter on a body that turns, with the reference's triangle.
//!
//! `cargo run --example particle_body_triangle`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("particle", helper::rotating_body(), helper::triangle())
}
