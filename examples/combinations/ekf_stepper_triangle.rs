//! The extended Kalman filter on an antenna on a stepper motor, with the reference's triangle.
//!
//! `cargo run --example ekf_stepper_triangle`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("ekf", helper::stepper(), helper::triangle())
}
