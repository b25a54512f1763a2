use nalgebra::{Matrix2, Vector2};

/// Extent of the receivers, and the largest distance of a place that is still meant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    pub(super) centre: Vector2<f64>,
    /// The largest distance of a receiver from the centre, in metres.
    pub(super) radius: f64,
    /// A thousand times that: a bearing would have to be good to a milliradian to distinguish such
    /// a place from infinity.
    pub(super) limit: f64,
}

/// The reach of receivers about their mean.
pub(super) fn reach(receivers: impl Iterator<Item = Vector2<f64>> + Clone) -> Reach {
    let mut sum = Vector2::zeros();
    let mut count = 0.0;
    for receiver in receivers.clone() {
        sum += receiver;
        count += 1.0;
    }
    let centre = sum / f64::max(count, 1.0);
    let radius = receivers.map(|r| (r - centre).norm()).fold(0.0, f64::max);
    Reach { centre, radius, limit: 1000.0 * radius }
}

/// The least over the largest singular value; 0 where they are not numbers.
pub(super) fn reciprocal_condition(matrix: &Matrix2<f64>) -> f64 {
    let values = matrix.singular_values();
    let ratio = values.min() / values.max();
    if ratio.is_finite() { ratio } else { 0.0 }
}
