//! Bearings alone on an antenna on a stepper motor, with the reference's triangle.
//!
//! `cargo run --example bearing_stepper_triangle`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("particle-bearing", helper::stepper(), helper::triangle())
}
