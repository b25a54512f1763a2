use foxhunt_core::{Estimate, Pose, Reception};
use nalgebra::{Matrix2, Vector2};

use super::{LocateConfig, LocateError, Located, Locator, located::levels};

/// The place of the strongest level; its covariance is the spread of the strongest tenth of all
/// levels about it. A baseline: it needs no law of propagation, and finds nothing beyond the
/// flight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Strongest;

impl Locator for Strongest {
    fn locate(&self, receptions: &[Reception], _: &LocateConfig) -> Result<Located, LocateError> {
        let mut levels = levels(receptions)?;
        let place = |at: &(Pose, f64)| at.0.position.xy();
        levels.sort_by(|a, b| b.1.total_cmp(&a.1));
        let strongest = place(levels.first().ok_or(LocateError::NoLevels)?);
        let tenth = levels.get(..levels.len().div_ceil(10)).unwrap_or_default();
        let spread = |sum: Matrix2<f64>, at: &(Pose, f64)| {
            let apart: Vector2<f64> = place(at) - strongest;
            sum + apart * apart.transpose()
        };
        let count = u32::try_from(tenth.len()).unwrap_or(u32::MAX);
        let covariance = tenth.iter().fold(Matrix2::zeros(), spread) / f64::from(count)
            + Matrix2::identity() * LEAST_SIGMA_M * LEAST_SIGMA_M;
        Ok(Located {
            observations: levels.len(),
            ..Located::at(Estimate { mean: strongest, covariance })
        })
    }
}

/// σ of a place that a satellite receiver gives, in metres: where there is one strongest level
/// alone, its place is no better known.
const LEAST_SIGMA_M: f64 = 3.0;
