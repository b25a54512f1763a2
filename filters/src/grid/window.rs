use foxhunt_core::EstimatorError;
use nalgebra::{Matrix2, Vector2};

use super::{Lattice, lattice::Moments};
use crate::vectorised::{Dot, Largest, run};

/// Cells below the most likely one by more than this, in nats, are not worth their memory: eight
/// standard deviations of a Gaussian.
const DEPTH: f64 = 32.0;

/// Gap (nats) between the likeliest cell and a border cell below which the lattice is too small:
/// five to six standard deviations.
const BORDER: f64 = 16.0;

/// A lattice that could be smaller than this share of its area is made so.
const WASTE: f64 = 0.4;

/// Fewer cells that carry the belief than this are too few: a Gaussian has 4π s² of them with a
/// standard deviation of s cells, so this is s = 1.1.
const FEWEST: f64 = 15.0;

/// Window that a belief needs of its lattice.
pub(super) struct Window {
    /// Centre and half sides of the belief.
    centre: Vector2<f64>,
    half_sides: Matrix2<f64>,
    /// True if the belief goes on beyond the border.
    cut: bool,
    /// 1 / Σ p²: how many cells carry it.
    effective_cells: f64,
}

impl Window {
    /// The window of a belief with these weights; `None` when none is positive.
    ///
    /// It lies along the belief's principal axes, or, where the target cannot leave the `widest`
    /// lattice, along that one's sides and within it: an edge must not cut through cells.
    pub(super) fn of(lattice: &Lattice, widest: Option<&Lattice>, weights: &[f64]) -> Option<Self> {
        let best = run(Largest(weights));
        if best.is_nan() || best <= 0.0 {
            return None;
        }
        let at_border = best * libm::exp(-BORDER);
        let cut = lattice.border().any(|i| weights[i] > at_border);
        let squares = run(Dot(weights, weights));
        let Moments { total, first, second } = lattice.moments(weights);
        let mean = first / total;
        // A cell's own spread keeps a belief in few cells from having no direction.
        let steps = lattice.steps();
        let spread = second / total - mean * mean.transpose() + steps * steps.transpose() / 12.0;
        let directions = match widest {
            Some(_) => Matrix2::identity(),
            None => spread.symmetric_eigen().eigenvectors,
        };
        // How far it goes along each: as far as the ends of the rows of cells do.
        let (mut low, mut high) =
            (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        for cells in lattice.carrying(weights, best * libm::exp(-DEPTH)) {
            for end in [cells.start, cells.end - 1] {
                let at = directions.tr_mul(&(lattice.place(end) - lattice.centre()));
                (low, high) = (low.inf(&at), high.sup(&at));
            }
        }
        // A cell and a half about: what lies between the cells is not known to be outside.
        let margin = directions.tr_mul(&steps).abs() * Vector2::repeat(1.5);
        let mut low = low - margin;
        let mut high = high + margin;
        if let Some(widest) = widest {
            let (centre, half) =
                (widest.centre() - lattice.centre(), widest.half_sides().diagonal());
            low = low.sup(&(centre - half));
            high = high.inf(&(centre + half));
        }
        let half = (high - low) * 0.5;
        let centre = lattice.centre() + directions * ((high + low) * 0.5);
        let half_sides = directions * Matrix2::from_diagonal(&half);
        let effective_cells = total * total / squares;
        Some(Self { centre, half_sides, cut, effective_cells })
    }

    /// Returns a lattice that suits the belief better than the present one, with `side` cells to a
    /// side where that is enough and at most `most`; `None` if the present one suits it.
    pub(super) fn better(
        &self,
        lattice: &Lattice,
        widest: Option<&Lattice>,
        side: usize,
        most: usize,
    ) -> Result<Option<Lattice>, EstimatorError> {
        let area = lattice.area();
        if self.cut
            && let Some(grown) = grown(lattice, widest, area)?
        {
            return Ok(Some(grown));
        }
        let tight = 4.0 * libm::fabs(self.half_sides.determinant()) < WASTE * area;
        if tight {
            return Lattice::new(self.centre, self.half_sides, side).map(Some);
        }
        if self.effective_cells < FEWEST && lattice.side() < most {
            return Ok(Some(lattice.with_side((2 * lattice.side()).min(most))));
        }
        Ok(None)
    }
}

/// Half as large again, but never more than the widest.
fn grown(
    lattice: &Lattice,
    widest: Option<&Lattice>,
    area: f64,
) -> Result<Option<Lattice>, EstimatorError> {
    let whole = widest.map(|widest| (widest, widest.area()));
    match whole {
        Some((widest, whole)) if area * 2.25 >= whole => {
            Ok((area < whole * 0.999).then(|| widest.with_side(lattice.side())))
        }
        _ => {
            let slope = Matrix2::identity() * 1.5;
            lattice.moved(lattice.centre(), &slope).map(Some)
        }
    }
}
