mod belief;
mod filter;
mod gate;
mod iterations;
mod linearisation;
mod models;
mod outliers;
mod presets;
mod regression;

pub use filter::{Ckf, Ekf, Kalman, Ukf};
pub use gate::{Gate, GateLimit};
pub use iterations::Iterations;
