//! The unscented Kalman filter on an antenna on a stepper motor, with the reference's triangle.
//!
//! `cargo run --example ukf_stepper_triangle`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("ukf", helper::stepper(), helper::triangle())
}
