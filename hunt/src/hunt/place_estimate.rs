use foxhunt_core::Estimate;
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
