//! What is measured: numbers, their noise, and which of them are missing.

mod error;
#[cfg(feature = "serde")]
mod file;
mod modes;
mod numbers;

pub use error::ObservationError;
pub use numbers::Observation;
