//! Models, observations and estimates of a size known at run time only, and the conversion of
//! vectors to one.

mod at_size;
mod estimate;
mod models;
mod observation;

pub use at_size::AtSize;
pub use estimate::DynamicEstimate;
pub use models::{DynamicMeasurement, DynamicMotion, Fixed, On};
pub use observation::DynamicObservation;

use nalgebra::{DVector, SVector};

/// The vector at its static size.
///
/// # Panics
///
/// If it has another length.
fn fixed<const N: usize>(vector: &DVector<f64>) -> SVector<f64, N> {
    SVector::from_column_slice(vector.as_slice())
}

/// The vector with its length known at run time.
fn dynamic<const N: usize>(vector: &SVector<f64, N>) -> DVector<f64> {
    DVector::from_column_slice(vector.as_slice())
}
