//! Terms that all examinations share.

use nalgebra::Vector2;

use super::{
    super::{LocateConfig, Power},
    fit::{Datum, Kind, Scale},
};

/// Number of measurements that a σ of their own is worth for the search of outliers.
const OWN_FREEDOM: f64 = 8.0;

/// σ of the receiver's place on each axis where none is stated, in metres: by satellites. Bearings
/// from a few metres away are of little use.
pub(super) const UNSTATED_SIGMA_M: f64 = 2.0;

/// Number of measurements that an assumed σ is worth.
const ASSUMED_FREEDOM: f64 = 4.0;

/// χ² with two degrees of freedom that a clean answer exceeds once in 10,000.
pub(super) const APART: f64 = 18.4;

/// Returns the knowledge of the measurements' σ.
pub(super) fn scale(data: &[Datum], config: &LocateConfig) -> Scale {
    let is_assumed = data.iter().any(|datum| is_assumed(datum, config));
    let least = if is_assumed { ASSUMED_FREEDOM } else { OWN_FREEDOM };
    Scale { freedom: config.bearing_freedom.max(least) }
}

/// Returns true if a bearing has the assumed σ of bearings without one.
pub(super) fn is_assumed(datum: &Datum, config: &LocateConfig) -> bool {
    let sigma = config.assumed_bearing_sigma;
    datum.kind == Kind::Bearing && sigma.is_some_and(|sigma| datum.sigma >= sigma)
}

/// Returns a place in the words of the report.
pub(super) fn spoken(place: &Vector2<f64>) -> String {
    format!("{:.1} m East, {:.1} m North", place.x, place.y)
}

/// Returns true if the power of the transmitter, and so a distance for each level, is known.
pub(super) fn has_law(config: &LocateConfig) -> bool {
    matches!(config.power, Power::Known { .. })
}
