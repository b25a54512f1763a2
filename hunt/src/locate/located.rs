#[cfg(feature = "batch")]
use foxhunt_core::{ByQuantity, Intake, Observation, Quantity};
use foxhunt_core::{Ellipse, Estimate, Pose, Reception};
use nalgebra::Vector2;

use super::{LocateConfig, LocateError};

/// A transmitter's place.
#[derive(Clone, Debug, PartialEq)]
pub struct Located {
    /// Where it is.
    pub estimate: Estimate<2>,
    /// The ellipse that holds it with 95 %, where that is not the one of the covariance: that of
    /// few bearings whose σ was itself estimated follows an F distribution.
    pub own_ellipse_95: Option<Ellipse>,
    /// How many receptions were used.
    pub observations: usize,
    /// How many a gate, or a weight of nothing, kept out.
    pub rejected: usize,
    /// The probability on the border of the area that was searched, where the estimator searches an
    /// area: where it is large, the transmitter may lie outside.
    pub border_mass: Option<f64>,
    /// Other places that are nearly as probable, the most probable first, where the estimator
    /// looks for them: levels from a straight flight are the same on either side.
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
    /// A place without anything else.
    #[must_use]
    pub fn at(estimate: Estimate<2>) -> Self {
        Self {
            estimate,
            own_ellipse_95: None,
            observations: 0,
            rejected: 0,
            border_mass: None,
            rivals: Vec::new(),
        }
    }

    /// The ellipse that holds the transmitter with 95 %; `None` when the covariance is not positive
    /// definite.
    #[must_use]
    pub fn ellipse_95(&self) -> Option<Ellipse> {
        self.own_ellipse_95.or_else(|| self.estimate.ellipse(0.95))
    }
}

/// Locates a transmitter from all receptions at once.
///
/// ```
/// use foxhunt_core::{Estimate, Reception};
/// use foxhunt_hunt::locate::{LocateConfig, LocateError, Located, Locator};
///
/// /// Where the level was highest.
/// struct Strongest;
///
/// impl Locator for Strongest {
///     fn locate(
///         &self,
///         receptions: &[Reception],
///         _: &LocateConfig,
///     ) -> Result<Located, LocateError> {
///         let level = |r: &&Reception| r.level.map_or(f64::NEG_INFINITY, |l| l.rss_dbm);
///         let strongest = receptions.iter().max_by(|a, b| level(a).total_cmp(&level(b)));
///         let strongest = strongest.ok_or(LocateError::Nothing { receptions: 0 })?;
///         Ok(Located::at(Estimate::isotropic(strongest.receiver.position.xy(), 50.0)))
///     }
/// }
/// ```
pub trait Locator: Send + Sync {
    /// The place of a transmitter that stays where it is, from the receptions of one or more
    /// drones: one drone after the other, each in the order of its path.
    ///
    /// # Errors
    ///
    /// [`LocateError`] when there is too little to go by, or they cannot be used.
    fn locate(
        &self,
        receptions: &[Reception],
        config: &LocateConfig,
    ) -> Result<Located, LocateError>;
}

/// Level and bearing of each reception.
#[cfg(feature = "batch")]
pub(super) fn pairs(receptions: &[Reception]) -> Result<Vec<Observation<2>>, LocateError> {
    let intake = ByQuantity([Quantity::RSS, Quantity::BEARING]);
    let mut observations = Vec::with_capacity(receptions.len());
    for (index, reception) in receptions.iter().enumerate() {
        let made = intake.observation(reception).map_err(|source| LocateError::Reception {
            index,
            time: reception.time,
            source: source.into(),
        })?;
        observations.extend(made);
    }
    Ok(observations)
}

/// The levels, each with its receiver, along the path.
pub(super) fn levels(receptions: &[Reception]) -> Result<Vec<(Pose, f64)>, LocateError> {
    let level = |r: &Reception| Some((r.receiver, r.level?.rss_dbm));
    let levels: Vec<_> = receptions.iter().filter_map(level).collect();
    if levels.is_empty() { Err(LocateError::NoLevels) } else { Ok(levels) }
}
