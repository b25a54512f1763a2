use alloc::{vec, vec::Vec};
use core::ops::Range;

use foxhunt_core::{EstimatorError, parameter::require};
use nalgebra::{LU, Matrix2, U2, Vector2};

use crate::{
    count::number,
    vectorised::{Kernel, dot, run, sum},
};

/// So many cells are looked at together.
const SEVERAL: usize = 16;

/// Equal cells over a rectangle that may lie aslant.
#[derive(Clone, Debug)]
pub(super) struct Lattice {
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
    pub(super) fn new(
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
    pub(super) fn with_side(&self, side: usize) -> Self {
        Self { side, along: along(side), ..self.clone() }
    }

    /// Returns the lattice after an affine motion.
    pub(super) fn moved(
        &self,
        centre: Vector2<f64>,
        slope: &Matrix2<f64>,
    ) -> Result<Self, EstimatorError> {
        Self::new(centre, slope * self.half_sides, self.side)
    }

    pub(super) fn centre(&self) -> Vector2<f64> {
        self.centre
    }

    /// From the centre to the middle of two sides, as columns.
    pub(super) fn half_sides(&self) -> &Matrix2<f64> {
        &self.half_sides
    }

    /// Cells along each side.
    pub(super) fn side(&self) -> usize {
        self.side
    }

    /// Returns the number of cells.
    pub(super) fn len(&self) -> usize {
        self.side * self.side
    }

    /// The steps from a cell to its neighbours along either side, as columns.
    pub(super) fn steps(&self) -> Matrix2<f64> {
        self.half_sides * (2.0 / number(self.side))
    }

    /// The area of all cells, in m².
    pub(super) fn area(&self) -> f64 {
        4.0 * libm::fabs(self.half_sides.determinant())
    }

    /// The area of one cell, in m².
    pub(super) fn cell_area(&self) -> f64 {
        self.area() / number(self.len())
    }

    /// The centre of a cell.
    pub(super) fn place(&self, index: usize) -> Vector2<f64> {
        let at = Vector2::new(self.along[index % self.side], self.along[index / self.side]);
        self.centre + self.half_sides * at
    }

    /// The centres of the cells of some rows, East and North as columns; sets `out`.
    pub(super) fn places(&self, rows: Range<usize>, out: &mut [Vec<f64>; 2]) {
        let along = &self.along;
        for (axis, out) in out.iter_mut().enumerate() {
            let half = [self.half_sides[(axis, 0)], self.half_sides[(axis, 1)]];
            out.resize(rows.len() * self.side, 0.0);
            run(Places { along, rows: rows.clone(), half, centre: self.centre[axis], out });
        }
    }

    /// The moments of the cells' places, each with its weight, about the centre.
    pub(super) fn moments(&self, weights: &[f64]) -> Moments {
        let [total, x, xx, y, xy, yy] = run(Sums { weights, along: &self.along });
        let half = &self.half_sides;
        Moments {
            total,
            first: half * Vector2::new(x, y),
            second: half * Matrix2::new(xx, xy, xy, yy) * half.transpose(),
        }
    }

    /// The cells of each row from the first to the last of more than this weight.
    pub(super) fn carrying(
        &self,
        weights: &[f64],
        least: f64,
    ) -> impl Iterator<Item = Range<usize>> {
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
    pub(super) fn in_coordinates_of(&self, other: &Self) -> (Vector2<f64>, Matrix2<f64>) {
        let origin = other.coordinates(&self.place(0));
        let steps = self.steps() * (0.5 * number(other.side));
        (origin, other.factor.solve(&steps).expect("the rectangle has an area"))
    }

    /// Returns the coordinates of a place, counted in cells from the centre of the first.
    pub(super) fn coordinates(&self, place: &Vector2<f64>) -> Vector2<f64> {
        let at = self.factor.solve(&(place - self.centre)).expect("the rectangle has an area");
        (at + Vector2::repeat(1.0)) * (0.5 * number(self.side)) - Vector2::repeat(0.5)
    }

    /// The cells that have no neighbour on some side.
    pub(super) fn border(&self) -> impl Iterator<Item = usize> {
        let side = self.side;
        let last = self.len() - self.side;
        let ends = (0..side).flat_map(move |i| [i * side, i * side + side - 1]);
        (0..side).chain(last..last + side).chain(ends)
    }
}

/// Σ w, Σ w x and Σ w x xᵀ over cells at x with the weights w.
pub(super) struct Moments {
    pub(super) total: f64,
    pub(super) first: Vector2<f64>,
    pub(super) second: Matrix2<f64>,
}

/// Returns the positions of `side` cells along a side, the whole side being −1 to 1.
fn along(side: usize) -> Vec<f64> {
    (0..side).map(|i| (2.0 * number(i) + 1.0) / number(side) - 1.0).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

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
        assert!((lattice.cell_area() - 4.0 * 7.5 / 81.0).abs() < 1e-12);
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
        assert!((total - sum).abs() < 1e-12 * sum);
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
