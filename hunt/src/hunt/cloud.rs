//! A belief in reports and logs: its moments, or places that stand for it.

use foxhunt_core::{Belief, Estimate};
use nalgebra::Vector2;
use serde::Serialize;

/// An estimate of a place in the local frame, as it stands in reports in JSON.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PlaceEstimate {
    /// East in metres.
    pub east_m: f64,
    /// North in metres.
    pub north_m: f64,
    /// The covariance of East and North, row by row.
    pub covariance_m2: [[f64; 2]; 2],
}

impl From<&Estimate<2>> for PlaceEstimate {
    fn from(estimate: &Estimate<2>) -> Self {
        let p = &estimate.covariance;
        Self {
            east_m: estimate.mean.x,
            north_m: estimate.mean.y,
            covariance_m2: [[p[(0, 0)], p[(0, 1)]], [p[(1, 0)], p[(1, 1)]]],
        }
    }
}

/// Number of places that stand for a belief in a log.
pub(super) const LOGGED_PLACES: u32 = 300;

/// A belief of fewer samples than this is given by its moments.
const LEAST: u32 = 100;

/// Returns `places` places of equal weight, East and North in metres, that stand for a cloud, or a
/// grid; `None` for a belief that its two moments give.
///
/// They are drawn systematically at even steps of the cumulative weight, without a random number,
/// so that a hunt is the same whether it is logged or not.
#[must_use]
pub fn cloud(belief: &dyn Belief, places: u32) -> Option<Vec<Vector2<f64>>> {
    let mut samples = 0_u32;
    let mut total = 0.0;
    belief.visit_positions(&mut |_, weight| {
        samples = samples.saturating_add(1);
        total += weight;
    });
    if samples < LEAST || places == 0 || !(total > 0.0 && total.is_finite()) {
        return None;
    }
    let step = total / f64::from(places);
    let mut places = Vec::new();
    let mut passed = 0.0;
    let mut next = 0.5 * step;
    belief.visit_positions(&mut |place, weight| {
        passed += weight;
        while next < passed && next < total {
            places.push(*place);
            next += step;
        }
    });
    places.iter().flatten().all(|coordinate| coordinate.is_finite()).then_some(places)
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_core::Estimate;

    use super::*;

    /// Places on the East axis, each as heavy as its number.
    struct Ladder(u32);

    impl Belief for Ladder {
        fn position(&self) -> Estimate<2> {
            Estimate::isotropic(Vector2::zeros(), 1.0)
        }

        fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64)) {
            let count = f64::from(self.0);
            for rung in 1..=self.0 {
                let weight = 2.0 * f64::from(rung) / (count * (count + 1.0));
                visit(&Vector2::new(f64::from(rung), 0.0), weight);
            }
        }
    }

    #[test]
    fn a_cloud_keeps_its_weights_and_a_gaussian_has_none() {
        let places = cloud(&Ladder(1000), 300).expect("many samples");
        assert_eq!(places.len(), 300);
        // A density that rises from 0 to 1000 has its mean at two thirds.
        let mean = places.iter().map(|place| place.x).sum::<f64>() / 300.0;
        assert_abs_diff_eq!(mean, 667.0, epsilon = 1.5);
        assert_eq!(cloud(&Estimate::isotropic(Vector2::zeros(), 1.0), 300), None);
        assert_eq!(cloud(&Ladder(99), 300), None);
    }
}
