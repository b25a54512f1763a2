use nalgebra::{DVector, SVector};

/// The vector at its static size.
///
/// # Panics
///
/// If it has another length.
pub(super) fn fixed<const N: usize>(vector: &DVector<f64>) -> SVector<f64, N> {
    SVector::from_column_slice(vector.as_slice())
}

/// The vector with its length known at run time.
pub(super) fn dynamic<const N: usize>(vector: &SVector<f64, N>) -> DVector<f64> {
    DVector::from_column_slice(vector.as_slice())
}
