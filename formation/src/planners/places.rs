use foxhunt_core::{Belief, Estimate, PlanError, Station};
use nalgebra::Vector2;

use crate::shape::number;

/// A place that can be gone to.
pub(crate) fn finite(place: Vector2<f64>) -> Result<Vector2<f64>, PlanError> {
    if place.x.is_finite() && place.y.is_finite() {
        Ok(place)
    } else {
        Err(PlanError::NotFinite { east: place.x, north: place.y })
    }
}

/// Returns the centroid of the drones, of which there must be at least one.
pub(crate) fn centroid(stations: &[Station]) -> Result<Vector2<f64>, PlanError> {
    if stations.is_empty() {
        return Err(PlanError::TooFew { needed: 1, have: 0 });
    }
    let sum: Vector2<f64> = stations.iter().map(|s| s.pose.position.xy()).sum();
    finite(sum / number(stations.len()))
}

/// The estimate and the centroid of the drones, where there are both.
pub(crate) fn estimate_and_centroid(
    belief: &dyn Belief,
    stations: &[Station],
) -> Result<(Estimate<2>, Vector2<f64>), PlanError> {
    let estimate = belief.position();
    finite(estimate.mean)?;
    Ok((estimate, centroid(stations)?))
}

/// The direction from `from` to `to`, in radians.
pub(crate) fn direction(from: &Vector2<f64>, to: &Vector2<f64>) -> f64 {
    libm::atan2(to.y - from.y, to.x - from.x)
}

/// The place at a distance in metres and a direction in radians from another one.
pub(crate) fn away(from: &Vector2<f64>, distance: f64, direction: f64) -> Vector2<f64> {
    from + Vector2::new(libm::cos(direction), libm::sin(direction)) * distance
}

/// The direction from a place to the drone that is nearest to it, in radians.
pub(crate) fn nearest_direction(place: &Vector2<f64>, stations: &[Station]) -> f64 {
    let distance = |s: &Station| (s.pose.position.xy() - place).norm();
    let nearest = stations.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
    nearest.map_or(0.0, |s| direction(place, &s.pose.position.xy()))
}
