use foxhunt_filters::BearingWeights;

use super::LocateEstimator;

/// An estimator that [`locate`](super::locate) alone knows by name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NamedLocateEstimator {
    /// What it is, in a line.
    pub about: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// The estimator, which has the name.
    pub estimator: LocateEstimator,
}

/// Where the paper's weights begin to fall (Lenth 1981, table 2).
const C: f64 = 1.5;

/// The estimators that work on all observations at once; besides these
/// [`locate`](super::locate) takes those that work on one after the other,
/// [`estimators`](crate::config::estimators).
#[must_use]
pub fn locate_estimators() -> Vec<NamedLocateEstimator> {
    let named = |estimator, about, source| NamedLocateEstimator { about, source, estimator };
    let lenth = |weights, about| named(LocateEstimator::Lenth1981(weights), about, "Lenth 1981");
    vec![
        named(
            LocateEstimator::ShadowingGrid,
            "all levels at once on a grid, with shadowing that is correlated along the flight",
            "Gudmundson 1991; Handcock & Stein 1993",
        ),
        named(
            LocateEstimator::Batch,
            "the most probable place, solved once over everything heard, Student's t; tells rivals",
            "Levenberg 1944; Marquardt 1963; Lange, Little & Taylor 1989",
        ),
        lenth(
            BearingWeights::Even,
            "where three or more bearings meet, maximum likelihood; their σ from how they scatter",
        ),
        lenth(
            BearingWeights::Huber { c: C },
            "the same with Huber's weights: bearings that stray count less",
        ),
        lenth(
            BearingWeights::Andrews { c: C },
            "the same with Andrews's weights: bearings that stray far do not count",
        ),
        named(
            LocateEstimator::FieldMap,
            "where the level is highest on a map of it (Gaussian process, no law of propagation)",
            "Rasmussen & Williams 2006; Handcock & Stein 1993",
        ),
    ]
}
