use alloc::vec::Vec;

use faer::Mat;
use foxhunt_core::{Pose, parameter::ParameterError};
use nalgebra::Vector2;

use super::{
    FieldMapConfig, FieldModel,
    covariance::{column, dot, matern},
    fit::Fit,
};
use crate::{
    batch::{BatchError, at_least},
    shadowing_grid::{Path, Segments, ShadowingGridError, Summary},
};

/// A Gaussian process through the levels that were read along a path (Rasmussen & Williams 2006;
/// kriging with an unknown mean): what the level is at any place, and where it is highest.
///
/// A reading is y = β + f(p) + e with f of Matérn's correlation of smoothness 3/2 and length ℓ, e
/// its own, both together of variance σ². ℓ and e's share of the variance have the largest marginal
/// likelihood on a small grid; they are then taken for known, so that the standard deviation is
/// somewhat too narrow where there are few readings.
///
/// It assumes no law of propagation and no antenna, only that the level varies smoothly with the
/// place over ground. That makes it a baseline: it cannot know of a transmitter that lies outside
/// of where was flown.
///
/// ```
/// use foxhunt_core::{Pose, nalgebra::Vector2};
/// use foxhunt_filters::{FieldMap, FieldMapConfig};
/// let readings: Vec<_> = (0..12)
///     .flat_map(|row| (0..12).map(move |column| (f64::from(row), f64::from(column))))
///     .map(|(row, column)| {
///         let pose = Pose::at(20.0 * column, 20.0 * row, 30.0);
///         let range = (pose.position.xy() - Vector2::new(130.0, 90.0)).norm().hypot(30.0);
///         (pose, -40.0 - 25.0 * range.log10())
///     })
///     .collect();
/// let config = FieldMapConfig { segment_m: 0.0, ..FieldMapConfig::default() };
/// let map = FieldMap::fit(&readings, &config)?;
/// let (near, far) = (map.level(&Vector2::new(130.0, 90.0)), map.level(&Vector2::zeros()));
/// assert!(near.0 > far.0 + 10.0 && near.1 < 1.0);
/// # Ok::<(), foxhunt_filters::BatchError>(())
/// ```
#[derive(Clone, Debug)]
pub struct FieldMap {
    pub(super) fit: Fit,
    pub(super) places: Vec<Vector2<f64>>,
    pub(super) config: FieldMapConfig,
}

impl FieldMap {
    /// The field through readings, each a receiver and a level, in the order in which they were
    /// taken.
    ///
    /// # Errors
    ///
    /// [`BatchError::Parameter`] and [`BatchError::TooFew`] name the setting that is out of range;
    /// [`BatchError::Value`] the reading that is not finite; [`BatchError::TooFew`] where the path
    /// makes fewer than four segments; [`BatchError::Flat`] when all readings were taken in one
    /// place, or have one value.
    pub fn fit(readings: &[(Pose, f64)], config: &FieldMapConfig) -> Result<Self, BatchError> {
        config.check()?;
        let most = config.max_segments as usize;
        let path = Path::new(readings)?;
        let Segments { receivers, values, .. } =
            path.segments(|_| config.segment_m, most, Summary::Quantile(0.5));
        if path.only_place().is_some() {
            return Err(BatchError::Flat { rcond: 0.0 });
        }
        at_least("segments of path", receivers.len(), 4)?;
        let places: Vec<_> = receivers.iter().map(|r| r.position.xy()).collect();
        let shares =
            |length_m: f64| config.noise_shares.iter().map(move |share| (length_m, *share));
        let choices = config.lengths_m.iter().flat_map(|length_m| shares(*length_m));
        let fits = choices.filter_map(|(length, share)| Fit::new(&places, &values, length, share));
        let best = fits.max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood));
        let fit = best.ok_or(BatchError::Flat { rcond: 0.0 })?;
        Ok(Self { fit, places, config: config.clone() })
    }

    /// The hyperparameters that were chosen.
    #[must_use]
    pub fn model(&self) -> &FieldModel {
        &self.fit.model
    }

    /// The level at a place, East and North in metres, and its standard deviation, both without a
    /// reading's own noise.
    #[must_use]
    pub fn level(&self, place: &Vector2<f64>) -> (f64, f64) {
        let (mean, covariance) = self.levels(core::slice::from_ref(place));
        (mean[0], libm::sqrt(f64::max(0.0, covariance[(0, 0)])))
    }

    /// The levels at some places together: their means and their covariance. With white the
    /// columns of L⁻¹ C(readings, places), that is
    /// σ² ((1 − ν) k − whiteᵀ white + open openᵀ), open = (1 − whiteᵀ u) / √(u·u) being what the
    /// unknown mean leaves open (Rasmussen & Williams 2006, eq. 2.42).
    pub(super) fn levels(&self, at: &[Vector2<f64>]) -> (Vec<f64>, Mat<f64>) {
        let Fit { correlation, model, residual, .. } = &self.fit;
        let share = 1.0 - model.noise_share;
        let mut white = Mat::<f64>::from_fn(self.places.len(), at.len(), |i, j| {
            share * matern(&self.places[i], &at[j], model.length_m)
        });
        correlation.whiten(&mut white);
        let ones = &correlation.ones;
        let size = libm::sqrt(dot(ones, ones));
        let columns = (0..at.len()).map(|j| column(&white, j));
        let (mean, open): (Vec<f64>, Vec<f64>) = columns
            .map(|white| (model.mean + dot(&white, residual), (1.0 - dot(ones, &white)) / size))
            .unzip();
        let explained = white.transpose() * &white;
        let variance = model.sigma * model.sigma;
        let covariance = Mat::<f64>::from_fn(at.len(), at.len(), |i, j| {
            let before = share * matern(&at[i], &at[j], model.length_m);
            variance * (before - explained[(i, j)] + open[i] * open[j])
        });
        (mean, covariance)
    }
}

/// Converts the reason that a path made no segments.
impl From<ShadowingGridError> for BatchError {
    fn from(error: ShadowingGridError) -> Self {
        let improper = |name, index, value| {
            let error = ParameterError { name, value, requirement: "finite" };
            Self::Value { index, error }
        };
        match error {
            ShadowingGridError::Parameter(error) => Self::Parameter(error),
            ShadowingGridError::Value { index, value } => improper("the level", index, value),
            ShadowingGridError::Receiver { index } => {
                improper("the receiver's pose", index, f64::NAN)
            }
            ShadowingGridError::TooFew { segments, .. } => {
                Self::TooFew { what: "segments of path", have: segments, need: 4 }
            }
            _ => Self::Flat { rcond: 0.0 },
        }
    }
}
