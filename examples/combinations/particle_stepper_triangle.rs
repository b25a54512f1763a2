//! The particle filter on an antenna on a stepper motor, with the reference's triangle.
//!
//! `cargo run --example particle_stepper_triangle`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("particle", helper::stepper(), helper::triangle())
}
