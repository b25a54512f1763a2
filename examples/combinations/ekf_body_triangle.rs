//! The extended Kalman filter on a body that turns, with the reference's triangle.
//!
//! `cargo run --example ekf_body_triangle`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("ekf", helper::rotating_body(), helper::triangle())
}
