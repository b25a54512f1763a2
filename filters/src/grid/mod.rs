//! Recursive Bayes over the cells of an area: the settings, the lattice of cells and the window of
//! them that follows the belief.

mod columns;
mod filter;
mod likelihood;
mod reading;
mod weights;

use alloc::{vec, vec::Vec};
use core::ops::Range;

use foxhunt_core::{
    EstimatorError,
    parameter::{ParameterError, positive, require},
};
use nalgebra::{LU, Matrix2, U2, Vector2};

use crate::{
    count::number,
    vectorised::{Dot, Kernel, Largest, dot, run, sum},
};

pub use filter::GridFilter;
#[cfg(feature = "batch")]
pub(crate) use weights::blur;

/// So many cells are looked at together.
const SEVERAL: usize = 16;

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

/// Settings of a [`GridFilter`]: its cells, and its doubts.
#[derive(Clone, Debug, PartialEq)]
pub struct GridConfig {
    /// Cells along each side of the area, 16 to 1024.
    pub side: usize,
    /// The most that a side is divided into where the belief is too thin, or in several places,
    /// for `side`; at least `side`, at most 1024.
    pub most_per_side: usize,
    /// The corners, south-west and north-east, of a rectangle outside of which the target cannot
    /// be, and within which every place is equally likely before the first observation; the prior's
    /// Gaussian in the plane where absent.
    pub area: Option<[Vector2<f64>; 2]>,
    /// Doubts about the noise that observations are given with; `None` for no doubt.
    pub noise_scales: Option<NoiseScales>,
    /// True if the expected value jumps from place to place, as a level does at the edge of a
    /// hill's shadow. Components that enter the measurement linearly are then not read between
    /// cells that disagree about them: the nearest one counts.
    pub cliffs: bool,
}

/// 64 cells to a side, at most 256; the prior's Gaussian; the noise as it is given; no cliffs.
impl Default for GridConfig {
    fn default() -> Self {
        Self { side: 64, most_per_side: 256, area: None, noise_scales: None, cliffs: false }
    }
}

impl GridConfig {
    /// Names the first setting that is out of its range, for measurements of `components`.
    fn check(&self, components: usize) -> Result<(), ParameterError> {
        let count = |name, value: usize, least: usize| {
            let requirement = "in 16..=1024, the most per side not below the side";
            require((least..=1024).contains(&value), name, crate::count::number(value), requirement)
        };
        count("cells per side", self.side, 16)?;
        count("most cells per side", self.most_per_side, self.side)?;
        if let Some([low, high]) = self.area {
            let size = (high - low).min();
            let finite = low.iter().chain(high.iter()).all(|c| c.is_finite());
            require(finite && size > 0.0, "the area's shorter side", size, "a positive number")?;
        }
        if let Some(NoiseScales { component, factors }) = &self.noise_scales {
            let index = crate::count::number(*component);
            require(*component < components, "the doubted component", index, "one there is")?;
            require(!factors.is_empty(), "the number of noise factors", 0.0, "at least 1")?;
            for &(factor, weight) in factors {
                for (name, value) in [("noise factor", factor), ("a noise factor's weight", weight)]
                {
                    positive(name, value)?;
                }
            }
        }
        Ok(())
    }
}

/// A component of the measurement whose standard deviation is not that of the observations
/// but that times one of these factors, the same one throughout.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseScales {
    /// Index of the component.
    pub component: usize,
    /// The factors, each with its prior weight; the weights need not sum to 1.
    pub factors: Vec<(f64, f64)>,
}

/// Equal cells over a rectangle that may lie aslant.
#[derive(Clone, Debug)]
struct Lattice {
    centre: Vector2<f64>,
    /// From the centre to the middle of two sides, as columns.
    half_sides: Matrix2<f64>,
    /// LU factors of `half_sides`.
    factor: LU<f64, U2, U2>,
    /// Cells along each side.
    side: usize,
    /// Positions of the cells along a side, the whole side being −1 to 1.
    along: Vec<f64>,
}

impl Lattice {
    /// `side`² cells over the rectangle with these half sides about `centre`.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when the rectangle has no area or is not finite.
    fn new(
        centre: Vector2<f64>,
        half_sides: Matrix2<f64>,
        side: usize,
    ) -> Result<Self, EstimatorError> {
        let value = libm::fabs(half_sides.determinant());
        let proper = value > 0.0 && value.is_finite() && centre.iter().all(|c| c.is_finite());
        require(proper, "the area of the grid", value, "a positive number")?;
        Ok(Self { centre, half_sides, factor: half_sides.lu(), side, along: along(side) })
    }

    /// Divides the rectangle into other cells.
    fn with_side(&self, side: usize) -> Self {
        Self { side, along: along(side), ..self.clone() }
    }

    /// Returns the lattice after an affine motion.
    fn moved(&self, centre: Vector2<f64>, slope: &Matrix2<f64>) -> Result<Self, EstimatorError> {
        Self::new(centre, slope * self.half_sides, self.side)
    }

    fn centre(&self) -> Vector2<f64> {
        self.centre
    }

    /// From the centre to the middle of two sides, as columns.
    fn half_sides(&self) -> &Matrix2<f64> {
        &self.half_sides
    }

    /// Cells along each side.
    fn side(&self) -> usize {
        self.side
    }

    /// Returns the number of cells.
    fn len(&self) -> usize {
        self.side * self.side
    }

    /// The steps from a cell to its neighbours along either side, as columns.
    fn steps(&self) -> Matrix2<f64> {
        self.half_sides * (2.0 / number(self.side))
    }

    /// The area of all cells, in m².
    fn area(&self) -> f64 {
        4.0 * libm::fabs(self.half_sides.determinant())
    }

    /// The area of one cell, in m².
    fn cell_area(&self) -> f64 {
        self.area() / number(self.len())
    }

    /// The centre of a cell.
    fn place(&self, index: usize) -> Vector2<f64> {
        let at = Vector2::new(self.along[index % self.side], self.along[index / self.side]);
        self.centre + self.half_sides * at
    }

    /// The centres of the cells of some rows, East and North as columns; sets `out`.
    fn places(&self, rows: Range<usize>, out: &mut [Vec<f64>; 2]) {
        let along = &self.along;
        for (axis, out) in out.iter_mut().enumerate() {
            let half = [self.half_sides[(axis, 0)], self.half_sides[(axis, 1)]];
            out.resize(rows.len() * self.side, 0.0);
            run(Places { along, rows: rows.clone(), half, centre: self.centre[axis], out });
        }
    }

    /// The moments of the cells' places, each with its weight, about the centre.
    fn moments(&self, weights: &[f64]) -> Moments {
        let [total, x, xx, y, xy, yy] = run(Sums { weights, along: &self.along });
        let half = &self.half_sides;
        Moments {
            total,
            first: half * Vector2::new(x, y),
            second: half * Matrix2::new(xx, xy, xy, yy) * half.transpose(),
        }
    }

    /// The cells of each row from the first to the last of more than this weight.
    fn carrying(&self, weights: &[f64], least: f64) -> impl Iterator<Item = Range<usize>> {
        let rows = weights.chunks_exact(self.side).enumerate();
        // Most cells before the first and behind the last are passed by several at once.
        let any = move |some: &[f64]| some.iter().fold(false, |any, w| any | (*w > least));
        rows.filter_map(move |(row, weights)| {
            let start = SEVERAL * weights.chunks(SEVERAL).position(any)?;
            let first = start + weights[start..].iter().position(|weight| *weight > least)?;
            let end = weights.len() - SEVERAL * weights.rchunks(SEVERAL).position(any)?;
            let last = weights[..end].iter().rposition(|weight| *weight > least)?;
            let start = row * weights.len();
            Some(start + first..start + last + 1)
        })
    }

    /// Returns the place of the first cell, counted in another lattice's cells from the centre of
    /// its first, and the steps to its neighbours along either side.
    fn in_coordinates_of(&self, other: &Self) -> (Vector2<f64>, Matrix2<f64>) {
        let origin = other.coordinates(&self.place(0));
        let steps = self.steps() * (0.5 * number(other.side));
        (origin, other.factor.solve(&steps).expect("the rectangle has an area"))
    }

    /// Returns the coordinates of a place, counted in cells from the centre of the first.
    fn coordinates(&self, place: &Vector2<f64>) -> Vector2<f64> {
        let at = self.factor.solve(&(place - self.centre)).expect("the rectangle has an area");
        (at + Vector2::repeat(1.0)) * (0.5 * number(self.side)) - Vector2::repeat(0.5)
    }

    /// The cells that have no neighbour on some side.
    fn border(&self) -> impl Iterator<Item = usize> {
        let side = self.side;
        let last = self.len() - self.side;
        let ends = (0..side).flat_map(move |i| [i * side, i * side + side - 1]);
        (0..side).chain(last..last + side).chain(ends)
    }
}

/// Σ w, Σ w x and Σ w x xᵀ over cells at x with the weights w.
struct Moments {
    total: f64,
    first: Vector2<f64>,
    second: Matrix2<f64>,
}

/// East or North of the cells of some rows.
struct Places<'a> {
    /// Positions of cells along a side of the lattice, −1 to 1.
    along: &'a [f64],
    rows: Range<usize>,
    /// East or North of the half sides.
    half: [f64; 2],
    centre: f64,
    out: &'a mut [f64],
}

impl Kernel for Places<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { along, rows, half, centre, out } = self;
        for (out, y) in out.chunks_exact_mut(along.len()).zip(&along[rows]) {
            let across = half[1] * y;
            out.iter_mut().zip(along).for_each(|(out, x)| *out = centre + (half[0] * x + across));
        }
    }
}

/// The sums of w, w x, w x², w y, w x y and w y² over square rows of weights w.
struct Sums<'a> {
    weights: &'a [f64],
    /// x and y of the cells along a side.
    along: &'a [f64],
}

impl Kernel for Sums<'_> {
    type Output = [f64; 6];

    #[inline(always)]
    fn run(self) -> [f64; 6] {
        let along = self.along;
        // Of each column of cells, those of w, w y and w y².
        let mut columns = vec![0.0; 3 * along.len()];
        let (plain, rest) = columns.split_at_mut(along.len());
        let (once, twice) = rest.split_at_mut(along.len());
        for (row, y) in self.weights.chunks_exact(along.len()).zip(along) {
            for (((plain, once), twice), weight) in
                plain.iter_mut().zip(&mut *once).zip(&mut *twice).zip(row)
            {
                let weighted = y * weight;
                *plain += weight;
                *once += weighted;
                *twice += y * weighted;
            }
        }
        let sums = [sum(plain), dot(plain, along), sum(once), dot(once, along), sum(twice)];
        plain.iter_mut().zip(along).for_each(|(plain, x)| *plain *= x);
        let [total, x, y, xy, yy] = sums;
        [total, x, dot(plain, along), y, xy, yy]
    }
}

/// Window that a belief needs of its lattice.
struct Window {
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
    fn of(lattice: &Lattice, widest: Option<&Lattice>, weights: &[f64]) -> Option<Self> {
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
    fn better(
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

/// Returns the positions of `side` cells along a side, the whole side being −1 to 1.
fn along(side: usize) -> Vec<f64> {
    (0..side).map(|i| (2.0 * number(i) + 1.0) / number(side) - 1.0).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    fn lattice() -> Lattice {
        let half_sides = Matrix2::new(3.0, -1.0, 1.5, 2.0);
        Lattice::new(Vector2::new(5.0, -2.0), half_sides, 9).expect("it has an area")
    }

    #[test]
    fn coordinates_invert_places() {
        let lattice = lattice();
        for i in 0..lattice.len() {
            let at = lattice.coordinates(&lattice.place(i));
            let cell = Vector2::new(number(i % 9), number(i / 9));
            assert!((at - cell).norm() < 1e-12, "{at}");
        }
        assert_abs_diff_eq!(lattice.cell_area(), 4.0 * 7.5 / 81.0, epsilon = 1e-12);
    }

    #[test]
    fn what_carries_a_row_goes_from_its_first_to_its_last_cell() {
        let half_sides = Matrix2::identity();
        let lattice = Lattice::new(Vector2::zeros(), half_sides, 50).expect("it has an area");
        let mut weights = vec![0.1; lattice.len()];
        for index in [3, 40, 60, 130, 149, 2499] {
            weights[index] = 0.5;
        }
        let carrying: Vec<_> = lattice.carrying(&weights, 0.2).collect();
        assert_eq!(carrying, [3..41, 60..61, 130..150, 2499..2500]);
    }

    #[test]
    fn moments_are_those_of_the_places() {
        let lattice = lattice();
        let weight = |i: usize| number(i % 7) + 0.1 * number(i % 4);
        let weights: Vec<f64> = (0..lattice.len()).map(weight).collect();
        let Moments { total, first, second } = lattice.moments(&weights);
        let mut sum = 0.0;
        let mut mean = Vector2::zeros();
        let mut square = Matrix2::zeros();
        for (i, weight) in weights.iter().enumerate() {
            let x = lattice.place(i) - lattice.centre();
            sum += weight;
            mean += x * *weight;
            square += x * x.transpose() * *weight;
        }
        assert_abs_diff_eq!(total, sum, epsilon = 1e-12 * sum);
        assert!((first - mean).norm() < 1e-12 * sum && (second - square).norm() < 1e-11 * sum);
    }

    #[test]
    fn another_lattice_has_coordinates_in_this_one() {
        let old = lattice();
        let new = lattice().with_side(5);
        let turned = Matrix2::new(0.6, -0.8, 0.8, 0.6);
        let new = new.moved(Vector2::new(4.0, -1.0), &turned).expect("it has an area");
        let (origin, steps) = new.in_coordinates_of(&old);
        for i in 0..new.len() {
            let at = origin + steps * Vector2::new(number(i % 5), number(i / 5));
            assert!((at - old.coordinates(&new.place(i))).norm() < 1e-12);
        }
    }
}
