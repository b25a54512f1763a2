//! Where a still transmitter is, from what was recorded of it.

mod batch;
mod config;
mod error;
mod sequential;

pub use config::{LocateConfig, LocateEstimator, Power};
pub use error::LocateError;

use foxhunt_core::{Estimate, Observation};

/// A transmitter's place.
#[derive(Clone, Debug, PartialEq)]
pub struct Located {
    /// Where it is.
    pub estimate: Estimate<2>,
    /// How many observations were used.
    pub observations: usize,
    /// How many a gate kept out.
    pub rejected: usize,
    /// The probability that the search put on the border of the area that it looked at, where
    /// the estimator looks at an area: a large one says that the transmitter may lie outside.
    pub border_mass: Option<f64>,
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
        LocateEstimator::ShadowingGrid => batch::locate(observations, config),
        LocateEstimator::Recursive(named) => {
            sequential::locate(observations, &named.config, config)
        }
    }
}
