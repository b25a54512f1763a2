//! Bearings alone on a body that turns, with the reference's triangle.
//!
//! `cargo run --example bearing_body_triangle`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("particle-bearing", helper::rotating_body(), helper::triangle())
}
