//! The unscented Kalman filter on a body that turns, with the reference's triangle.
//!
//! `cargo run --example ukf_body_triangle`

mod helper;

fn main() -> Result<(), Box<dyn helper::Error>> {
    helper::hunt("ukf", helper::rotating_body(), helper::triangle())
}
