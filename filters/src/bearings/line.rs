use nalgebra::Vector2;

use crate::batch::{BatchError, at_least, finite_entry};

/// A bearing taken at a place: a ray in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingLine {
    /// East and North of the receiver in metres.
    pub receiver: Vector2<f64>,
    /// The direction of the target, in radians counter-clockwise from East.
    pub bearing: f64,
}

impl BearingLine {
    /// The line's unit normal (sin θ, −cos θ): the signed distance of a place from the line is its
    /// product with the way from the receiver.
    pub(super) fn normal(&self) -> Vector2<f64> {
        Vector2::new(libm::sin(self.bearing), -libm::cos(self.bearing))
    }

    /// The direction from the receiver to a place.
    pub(super) fn towards(&self, place: &Vector2<f64>) -> f64 {
        let way = place - self.receiver;
        libm::atan2(way.y, way.x)
    }

    /// The cosine of the bearing's error if the target is at a place.
    pub(super) fn cosine(&self, place: &Vector2<f64>) -> f64 {
        libm::cos(self.bearing - self.towards(place))
    }

    /// Returns true if a place lies on the side that the bearing points to.
    pub(super) fn looks_at(&self, place: &Vector2<f64>) -> bool {
        self.cosine(place) > 0.0
    }
}

/// Refuses lines that are too few or not finite.
pub(super) fn check<'a>(
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
