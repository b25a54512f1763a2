//! Localisation by lines of bearing.

mod closed_forms;
mod grid;
mod lenth1981;

use nalgebra::{Matrix2, Vector2};

use crate::batch::{BatchError, at_least, finite_entry, positive_entry};

pub use closed_forms::{
    RepeatedMedianFix, instrumental_variables, pseudolinear, repeated_median, stansfield,
};
pub use grid::{BearingGrid, BearingGridFix, CommonErrors, StationError};
pub use lenth1981::{BearingFix, BearingWeights, Lenth1981};

/// A bearing taken at a place: a ray in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingLine {
    /// East and North of the receiver in metres.
    pub receiver: Vector2<f64>,
    /// The direction of the target, in radians counter-clockwise from East.
    pub bearing: f64,
}

impl BearingLine {
    /// The line's unit normal (sin θ, −cos θ): the signed distance of a place from the line is
    /// its product with the way from the receiver.
    fn normal(&self) -> Vector2<f64> {
        Vector2::new(libm::sin(self.bearing), -libm::cos(self.bearing))
    }

    /// The direction from the receiver to a place.
    fn towards(&self, place: &Vector2<f64>) -> f64 {
        let way = place - self.receiver;
        libm::atan2(way.y, way.x)
    }

    /// The cosine of the bearing's error if the target is at a place.
    fn cosine(&self, place: &Vector2<f64>) -> f64 {
        libm::cos(self.bearing - self.towards(place))
    }

    /// Returns true if a place lies on the side that the bearing points to.
    fn looks_at(&self, place: &Vector2<f64>) -> bool {
        self.cosine(place) > 0.0
    }
}

/// Extent of the receivers, and the largest distance of a place that is still meant.
#[derive(Clone, Copy, Debug)]
struct Reach {
    centre: Vector2<f64>,
    /// The largest distance of a receiver from the centre, in metres.
    radius: f64,
    /// A thousand times that: a bearing would have to be good to a milliradian to distinguish such
    /// a place from infinity.
    limit: f64,
}

/// Refuses lines that are too few or not finite.
fn check<'a>(
    lines: impl ExactSizeIterator<Item = &'a BearingLine>,
    need: usize,
) -> Result<(), BatchError> {
    at_least("bearings", lines.len(), need)?;
    for (index, line) in lines.enumerate() {
        finite_entry("the receiver's East", index, line.receiver.x)?;
        finite_entry("the receiver's North", index, line.receiver.y)?;
        finite_entry("the bearing", index, line.bearing)?;
    }
    Ok(())
}

/// Refuses bearings that are too few or not finite, and a σ that is not positive.
fn checked(bearings: &[(BearingLine, f64)], need: usize) -> Result<(), BatchError> {
    check(bearings.iter().map(|(line, _)| line), need)?;
    for (index, (_, sigma)) in bearings.iter().enumerate() {
        positive_entry("the bearing's sigma", index, *sigma)?;
    }
    Ok(())
}

/// The reach of receivers about their mean.
fn reach(receivers: impl Iterator<Item = Vector2<f64>> + Clone) -> Reach {
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
fn reciprocal_condition(matrix: &Matrix2<f64>) -> f64 {
    let values = matrix.singular_values();
    let ratio = values.min() / values.max();
    if ratio.is_finite() { ratio } else { 0.0 }
}
