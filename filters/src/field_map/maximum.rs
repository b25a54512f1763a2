use alloc::{vec, vec::Vec};

use faer::{Mat, Side, linalg::solvers::Llt};
use foxhunt_core::{Belief, Estimate};
use nalgebra::Vector2;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use super::FieldMap;
use crate::{
    PosteriorMap,
    batch::{BatchError, at_least, positive},
    shadowing_grid::Grid,
};

/// Where a field is highest.
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

/// So many fields are drawn at once.
const DRAWN_AT_ONCE: usize = 256;

/// What is added to a cell's variance, as a share of σ², so that rounding leaves a factor.
const JITTER: f64 = 1e-8;

impl FieldMap {
    /// Where the field is highest over the receivers' bounding box and `margin_m` about it: the
    /// share of `samples` fields, drawn from the posterior, that have their maximum in each cell.
    ///
    /// Cells have a side of `cell_m`, or more where there would be more than `max_cells`; time
    /// grows with the cube of their number and memory with the square: 900 take 10 MB. The
    /// generator comes from outside; same seed, same result.
    ///
    /// # Errors
    ///
    /// [`BatchError::Setting`] for a margin that is negative, or cells that are not of a positive
    /// size; [`BatchError::TooFew`] below 16 cells or without a sample; [`BatchError::Improper`]
    /// when the posterior has no factor.
    pub fn maximum<R: Rng>(
        &self,
        margin_m: f64,
        cell_m: f64,
        max_cells: u32,
        samples: u32,
        rng: &mut R,
    ) -> Result<FieldMaximum, BatchError> {
        if !(margin_m >= 0.0 && margin_m.is_finite()) {
            let (name, value) = ("margin_m", margin_m);
            return Err(BatchError::Setting { name, value, requirement: "a number from 0 on" });
        }
        at_least("max_cells", max_cells as usize, 16)?;
        at_least("samples", samples as usize, 1)?;
        let grid = self.grid(margin_m, positive("cell_m", cell_m)?, max_cells);
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

    fn grid(&self, margin_m: f64, cell_m: f64, max_cells: u32) -> Grid {
        let nowhere = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        let (low, high) =
            self.places.iter().fold(nowhere, |(low, high), p| (low.inf(p), high.sup(p)));
        let margin = Vector2::repeat(margin_m);
        Grid::over(low - margin, high + margin, cell_m, max_cells)
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
