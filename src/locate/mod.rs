//! Where a still transmitter is, from what was recorded of it.

mod area;
mod batch;
mod bearings;
mod config;
mod error;
mod field_map;
mod levels;
mod located;
mod named;
mod sequential;
mod shadowing_grid;

pub use config::{LocateConfig, LocateEstimator, Power};
pub use error::LocateError;
pub use located::{Located, Rival, locate};
pub use named::{NamedLocateEstimator, locate_estimators};
