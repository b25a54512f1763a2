//! Measurements: numbers, their noise, and the marks of missing ones.

mod error;
#[cfg(feature = "serde")]
mod file;
mod modes;
mod numbers;

pub use error::ObservationError;
pub use numbers::Observation;
