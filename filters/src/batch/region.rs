use nalgebra::Vector2;

/// Disc that the iterates stay in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Region {
    pub(super) centre: Vector2<f64>,
    /// Radius in metres; infinite where a prior keeps the optimum near.
    pub(super) limit: f64,
}
