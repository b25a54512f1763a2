mod filter;
mod gate;
mod models;
mod presets;
mod regression;

pub use filter::{Ekf, Kalman, Ukf};
pub use gate::{Gate, GateLimit};
pub use regression::Innovation;
