//! Terms that all examinations share.

use foxhunt_core::{Bearing, Quantity, Reception, Receptions};
use nalgebra::Vector2;

use super::{
    super::{LocateConfig, RangeBias},
    fit::{Datum, Kind, Scale},
};

/// Receptions with measurements that an answer depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Uses {
    /// Levels.
    pub levels: bool,
    /// Bearings.
    pub bearings: bool,
    /// Differences of ranges.
    pub differences: bool,
    /// The estimator searches a square about the receivers and does not report the probability on
    /// its border.
    pub searches_area: bool,
}

/// Names that remarks give to receptions by their index, where they have any: file and line.
pub(crate) type Name<'a> = &'a dyn Fn(usize) -> Option<String>;

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

/// Returns the measurements with a geometry that an estimator uses; `bias` is taken off the
/// ranges.
pub(super) fn data(
    receptions: &Receptions,
    config: &LocateConfig,
    uses: Uses,
    bias: Option<RangeBias>,
) -> Vec<Datum> {
    let mut data = Vec::new();
    let holds = |kind: &Reception| kind.has_bearing() || !kind.measured.is_empty();
    // There may be millions of levels, which have no geometry.
    if !receptions.kinds().iter().any(holds) {
        return data;
    }
    for (reception, received) in receptions.iter().enumerate() {
        let receiver = received.receiver.position;
        let of_receiver = received.receiver_sigma_m.map(|sigma| sigma.x.max(sigma.y));
        let datum = |kind, value, sigma| {
            let unstated = if kind == Kind::Bearing { UNSTATED_SIGMA_M } else { 0.0 };
            let receiver_sigma_m = of_receiver.unwrap_or(unstated);
            Datum { reception, kind, receiver, value, sigma, receiver_sigma_m }
        };
        // Directions that compete have no common one to be tested.
        if let Some(Bearing { angle, sigma, .. }) = received.bearing
            && uses.bearings
            && received.modes.is_empty()
        {
            data.push(datum(Kind::Bearing, angle, sigma));
        }
        if let Some(range) = received.measured.get(Quantity::RANGE) {
            let value = bias.map_or(range.value, |bias| bias.without(range.value));
            data.push(datum(Kind::Range, value, range.sigma));
        }
        if let Some(difference) = received.measured.get(Quantity::RANGE_DIFFERENCE)
            && let Some(reference) = config.reference_m
            && uses.differences
        {
            let kind = Kind::Difference(reference);
            data.push(datum(kind, difference.value, difference.sigma));
        }
    }
    data
}

/// Returns a place in the words of the report.
pub(super) fn spoken(place: &Vector2<f64>) -> String {
    format!("{:.1} m East, {:.1} m North", place.x, place.y)
}

/// Returns true if the power of the transmitter, and so a distance for each level, is known.
pub(super) fn has_law(config: &LocateConfig) -> bool {
    config.power.law().is_some()
}
