//! From readings at known ranges to the law of propagation.

mod error;
mod fit;

pub use error::CalibrationError;
pub use fit::{PathLossFit, fit_log_distance};
