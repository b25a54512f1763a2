use foxhunt_core::{Estimate, Observation};
use nalgebra::Vector2;

use super::{
    LocateConfig, LocateError, LocateEstimator, batch, bearings, field_map, sequential,
    shadowing_grid,
};

/// A transmitter's place.
#[derive(Clone, Debug, PartialEq)]
pub struct Located {
    /// Where it is.
    pub estimate: Estimate<2>,
    /// How many observations were used.
    pub observations: usize,
    /// How many a gate, or a weight of nothing, kept out.
    pub rejected: usize,
    /// The probability that the search put on the border of the area that it looked at, where
    /// the estimator looks at an area: a large one says that the transmitter may lie outside.
    pub border_mass: Option<f64>,
    /// Other places that are nearly as probable, the most probable first, where the estimator
    /// looks for them: levels from a straight flight do not tell one side from the other.
    pub rivals: Vec<Rival>,
}

/// Another place where the posterior density has a maximum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rival {
    /// Where, East and North in metres.
    pub place: Vector2<f64>,
    /// The density there over that at the estimate, from 0.01 to 1.
    pub relative_density: f64,
}

impl Located {
    /// A place, and nothing else told yet.
    pub(super) fn at(estimate: Estimate<2>) -> Self {
        Self { estimate, observations: 0, rejected: 0, border_mass: None, rivals: Vec::new() }
    }
}

/// Locates a transmitter that stays where it is, from what one or more drones heard: one drone
/// after the other, each in the order of its path.
///
/// # Errors
///
/// [`LocateError`] when there is too little to go by, or the estimator cannot use it.
pub fn locate(
    observations: &[Observation<2>],
    config: &LocateConfig,
) -> Result<Located, LocateError> {
    let heard = observations.iter().filter(|o| !o.is_empty()).count();
    if heard == 0 {
        return Err(LocateError::Nothing { observations: observations.len() });
    }
    match &config.estimator {
        LocateEstimator::ShadowingGrid => shadowing_grid::locate(observations, config),
        LocateEstimator::Lenth1981(weights) => {
            bearings::locate(observations, *weights, config.estimator.name())
        }
        LocateEstimator::FieldMap => field_map::locate(observations, config),
        LocateEstimator::Batch => batch::locate(observations, config),
        LocateEstimator::Recursive(named) => {
            sequential::locate(observations, &named.config, config)
        }
    }
}
