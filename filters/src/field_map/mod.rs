//! The received level over the area, and where it is highest: no law of propagation.

mod config;
mod covariance;
mod field;
mod fit;
mod maximum;

pub use config::{FieldMapConfig, FieldModel};
pub use field::FieldMap;
pub use maximum::FieldMaximum;
