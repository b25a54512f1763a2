//! Models, observations and estimates of a size known at run time only.

mod at_size;
mod estimate;
mod models;
mod observation;
mod vector;

pub use at_size::AtSize;
pub use estimate::DynamicEstimate;
pub use models::{DynamicMeasurement, DynamicMotion, Fixed, On};
pub use observation::DynamicObservation;
