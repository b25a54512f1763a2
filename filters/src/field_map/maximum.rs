use alloc::{vec, vec::Vec};

use faer::{Mat, Side, linalg::solvers::Llt};
use foxhunt_core::{Belief, Estimate};
use nalgebra::Vector2;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use super::FieldMap;
use crate::{PosteriorMap, batch::BatchError, shadowing_grid::Grid};

/// Place where a field is highest.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldMaximum {
    /// The mean and covariance of the place of the maximum, East and North in metres.
    pub position: Estimate<2>,
    /// The centre of the cell with the largest expected level.
    pub highest_mean: Vector2<f64>,
    /// The probability that the maximum lies in each cell.
    pub map: PosteriorMap,
}

/// The cells with a probability, as a planner sees them.
impl Belief for FieldMaximum {
    fn position(&self) -> Estimate<2> {
        self.position
    }

    fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64)) {
        let cells = self.map.cells().filter(|&(_, mass)| mass > 0.0);
        cells.for_each(|(place, mass)| visit(&place, mass));
    }
}

/// Number of fields drawn at once.
const DRAWN_AT_ONCE: usize = 256;

/// Addition to a cell's variance, as a share of σ², so that rounding leaves a factor.
const JITTER: f64 = 1e-8;

impl FieldMap {
    /// Locates the field's maximum over the receivers' bounding box and a margin about it: the
    /// share of fields, drawn from the posterior, that have their maximum in each cell.
    ///
    /// The generator comes from outside; same seed, same result.
    ///
    /// # Errors
    ///
    /// [`BatchError::Improper`] when the posterior has no factor.
    pub fn maximum<R: Rng>(&self, rng: &mut R) -> Result<FieldMaximum, BatchError> {
        let grid = self.grid();
        let samples = self.config.samples;
        let places: Vec<_> = (0..grid.len()).map(|cell| grid.centre(cell)).collect();
        let (mean, factor) = self.posterior(&places)?;
        let mut wins = vec![0_u32; places.len()];
        let mut left = samples as usize;
        while left > 0 {
            let count = left.min(DRAWN_AT_ONCE);
            left -= count;
            let white = Mat::<f64>::from_fn(places.len(), count, |_, _| rng.sample(StandardNormal));
            let fields = factor.L() * &white;
            for j in 0..count {
                let level = |i: usize| mean[i] + fields[(i, j)];
                wins[highest(places.len(), level)] += 1;
            }
        }
        let share = |wins: &u32| f64::from(*wins) / f64::from(samples);
        let map = PosteriorMap::new(grid, wins.iter().map(share).collect());
        let highest_mean = places[highest(places.len(), |i| mean[i])];
        Ok(FieldMaximum { position: map.estimate(), highest_mean, map })
    }

    fn grid(&self) -> Grid {
        let nowhere = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        let (low, high) =
            self.places.iter().fold(nowhere, |(low, high), p| (low.inf(p), high.sup(p)));
        let margin = Vector2::repeat(self.config.margin_m);
        Grid::over(low - margin, high + margin, self.config.cell_m, self.config.max_cells)
    }

    /// The mean and a factor of the covariance of the levels at some places together.
    fn posterior(&self, places: &[Vector2<f64>]) -> Result<(Vec<f64>, Llt<f64>), BatchError> {
        let (mean, mut covariance) = self.levels(places);
        let sigma = self.model().sigma;
        (0..places.len()).for_each(|i| covariance[(i, i)] += JITTER * sigma * sigma);
        let factor = Llt::new(covariance.as_ref(), Side::Lower);
        let improper = BatchError::Improper { what: "field's posterior" };
        Ok((mean, factor.map_err(|_| improper)?))
    }
}

/// The index with the largest level.
fn highest(count: usize, level: impl Fn(usize) -> f64) -> usize {
    (0..count).max_by(|a, b| level(*a).total_cmp(&level(*b))).unwrap_or_default()
}
