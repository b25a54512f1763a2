use foxhunt_core::Observation;
use foxhunt_filters::BearingWeights;

use super::locate_estimators;
use crate::config::{NamedEstimator, estimator_named};

/// How [`locate`](super::locate) goes about it.
#[derive(Clone, Debug, PartialEq)]
pub struct LocateConfig {
    /// What turns the observations into a place.
    pub estimator: LocateEstimator,
    /// What is known of the transmitter's power.
    pub power: Power,
    /// How high above the ground of the local frame the transmitter is taken to be, in metres.
    pub target_up_m: f64,
    /// How far the transmitter may lie beyond the area in which it was listened for, in metres.
    pub margin_m: f64,
    /// The seed of estimators that draw random numbers.
    pub seed: u64,
}

/// What is known of a transmitter's power.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Power {
    /// Nothing: the reference power is found along with the place. The exponent is, too, where
    /// the estimator can; else it is 2.3.
    Free,
    /// P(d) = P₀ − 10 γ log₁₀ d.
    Known {
        /// P₀ in dBm.
        reference_dbm: f64,
        /// γ.
        exponent: f64,
    },
}

/// What turns observations into a place.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "there is one of it in a run")]
pub enum LocateEstimator {
    /// All levels at once on a grid, with shadowing that is correlated along the flight
    /// (`filters::ShadowingGrid`).
    ShadowingGrid,
    /// Where the bearings meet, by maximum likelihood or by M-estimation (`filters::Lenth1981`).
    Lenth1981(BearingWeights),
    /// Where the level is highest on a map without any law of propagation (`filters::FieldMap`):
    /// a baseline, that cannot know of a transmitter outside of where was flown.
    FieldMap,
    /// The most probable place given all levels and bearings at once, with residuals as Student's
    /// t has them and all σ inflated as they scatter, from nine starts (`filters::BatchSolver`);
    /// other optima are told as [`Rival`](super::Rival)s. It takes errors for independent: its
    /// ellipse is much too small where neighbouring levels fade alike, as along a flight.
    Batch,
    /// One observation after the other through an estimator that has a name.
    Recursive(NamedEstimator),
}

impl LocateEstimator {
    /// The estimator of a name: one of [`locate_estimators`], else of
    /// [`estimators`](crate::config::estimators).
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let own = locate_estimators().into_iter().find(|known| known.estimator.name() == name);
        own.map(|known| known.estimator).or_else(|| estimator_named(name).map(Self::Recursive))
    }

    /// The one that suits some observations: the grid where there are levels alone, else the
    /// particle filter, which takes bearings as they are.
    #[must_use]
    pub fn suited_to(observations: &[Observation<2>]) -> Self {
        let bearings = observations.iter().any(|o| o.has(1));
        match estimator_named("particle") {
            Some(particle) if bearings => Self::Recursive(particle),
            _ => Self::ShadowingGrid,
        }
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::ShadowingGrid => "shadowing-grid",
            Self::Lenth1981(BearingWeights::Huber { .. }) => "lenth1981-huber",
            Self::Lenth1981(BearingWeights::Andrews { .. }) => "lenth1981-andrews",
            Self::Lenth1981(_) => "lenth1981",
            Self::FieldMap => "field-map",
            Self::Batch => "batch",
            Self::Recursive(named) => named.name,
        }
    }
}

impl LocateConfig {
    /// Free power, a transmitter on the ground, 200 m beyond the area of listening, seed 1.
    #[must_use]
    pub fn new(estimator: LocateEstimator) -> Self {
        Self { estimator, power: Power::Free, target_up_m: 0.0, margin_m: 200.0, seed: 1 }
    }
}
