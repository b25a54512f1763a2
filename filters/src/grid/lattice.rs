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
    /// Of `half_sides`.
    factor: LU<f64, U2, U2>,
    /// Cells along each side.
    side: usize,
    /// Where they are along it, the whole side being −1 to 1.
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

    /// The same rectangle in other cells.
    pub(super) fn with_side(&self, side: usize) -> Self {
        Self { side, along: along(side), ..self.clone() }
    }

    /// Where the cells are after an affine motion.
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

    /// How many cells there are.
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

    /// Where the first cell is, counted in another lattice's cells from the centre of the first of
    /// these, and how far its neighbours are from it along either side.
    pub(super) fn in_coordinates_of(&self, other: &Self) -> (Vector2<f64>, Matrix2<f64>) {
        let origin = other.coordinates(&self.place(0));
        let steps = self.steps() * (0.5 * number(other.side));
        (origin, other.factor.solve(&steps).expect("the rectangle has an area"))
    }

    /// Where a place lies, counted in cells from the centre of the first.
    pub(super) fn coordinates(&self, place: &Vector2<f64>) -> Vector2<f64> {
        let at = self.factor.solve(&(place - self.centre)).expect("the rectangle has an area");
        (at + Vector2::repeat(1.0)) * (0.5 * number(self.side)) - Vector2::repeat(0.5)
    }

    /// The cells that have no neighbour on some side.
    pub(super) fn border(&self) -> impl Iterator<Item = usize> {
        let (side, last) = (self.side, self.len() - self.side);
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

/// Where so many cells are along a side, the whole side being −1 to 1.
fn along(side: usize) -> Vec<f64> {
    (0..side).map(|i| (2.0 * number(i) + 1.0) / number(side) - 1.0).collect()
}

/// East or North of the cells of some rows.
struct Places<'a> {
    /// Where cells are along a side of the lattice, −1 to 1.
    along: &'a [f64],
    rows: Range<usize>,
    /// Of the half sides.
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

/// How a column is read between cells by cubic convolution (Keys 1981), which is exact for
/// quadratics, the logarithms of Gaussians: the weights of 4 × 4 cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stencil {
    /// The cell of the first weights.
    first: usize,
    nearest: usize,
    weights_x: [f64; 4],
    weights_y: [f64; 4],
    /// Behind which of the four the place lies, along either side, and the share of the way to the
    /// next.
    behind: [usize; 2],
    share: [f64; 2],
}

/// Logarithms that are bent by no more than this from cell to cell are read as they are: it makes
/// an eighth of it between them, where bearings of a hunt are bent by hundreds.
const BEND: f64 = 20.0;

impl Stencil {
    /// The one for a place in a lattice with so many cells to a side; `at` as from
    /// [`Lattice::coordinates`]. Outside, what stands on the border.
    #[inline(always)]
    pub(super) fn at(at: &Vector2<f64>, side: usize) -> Self {
        let last = number(side - 1);
        let at = at.map(|c| c.clamp(0.0, last));
        let ((x, weights_x), (y, weights_y)) = (taps(at.x, side), taps(at.y, side));
        let nearest = index(at.y + 0.5) * side + index(at.x + 0.5);
        let low = [at.x, at.y].map(|at| index(at).min(side - 2));
        let share = [at.x - number(low[0]), at.y - number(low[1])];
        let behind = [low[0] - x, low[1] - y];
        Self { first: y * side + x, nearest, weights_x, weights_y, behind, share }
    }

    /// The nearest cell.
    pub(super) fn nearest(&self) -> usize {
        self.nearest
    }

    /// How far apart the numbers are that it takes.
    pub(super) fn range(&self, column: &[f64], side: usize) -> f64 {
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for j in 0..4 {
            let first = self.first + j * side;
            for value in &column[first..first + 4] {
                (least, most) = (least.min(*value), most.max(*value));
            }
        }
        most - least
    }

    /// The same for a logarithm that may fall off a cliff between two cells, as it does where all
    /// bearings meet: beside one, cubics overshoot by a share of its height.
    #[inline(always)]
    pub(super) fn read_log(&self, column: &[f64], side: usize) -> f64 {
        let along = core::array::from_fn(|j| {
            let first = self.first + j * side;
            let row = core::array::from_fn(|i| column[first + i]);
            bent(row, self.behind[0], self.share[0])
        });
        let log = bent(along, self.behind[1], self.share[1]);
        if log.is_finite() { log } else { column[self.nearest] }
    }

    /// Where a number that it takes is infinite, the nearest cell's.
    #[inline(always)]
    pub(super) fn read(&self, column: &[f64], side: usize) -> f64 {
        let mut along = [0.0; 4];
        for (j, weight) in self.weights_y.iter().enumerate() {
            let first = self.first + j * side;
            along.iter_mut().zip(&column[first..first + 4]).for_each(|(sum, v)| *sum += weight * v);
        }
        let [a, b, c, d] = self.weights_x;
        let sum = (a * along[0] + b * along[1]) + (c * along[2] + d * along[3]);
        if sum.is_finite() { sum } else { column[self.nearest] }
    }
}

/// What lies behind one of four neighbours, at the share `t` of the way to the next: on the two
/// parabolas through three of them, weighted by their nearness, as [`keys`] has it; but bent no
/// more than twice what either of the two is.
#[inline(always)]
fn bent(four: [f64; 4], behind: usize, t: f64) -> f64 {
    let [a, b, c, d] = match behind {
        0 => [3.0 * (four[0] - four[1]) + four[2], four[0], four[1], four[2]],
        2 => [four[1], four[2], four[3], 3.0 * (four[3] - four[2]) + four[1]],
        _ => four,
    };
    let (before, after) = ((a - b) + (c - b), (b - c) + (d - c));
    let least = if before * after > 0.0 { before.abs().min(after.abs()) } else { 0.0 };
    let most = (2.0 * least).max(BEND);
    let bend = ((1.0 - t) * before + t * after).clamp(-most, most);
    b + t * (c - b) - 0.5 * t * (1.0 - t) * bend
}

/// The first of four neighbours along a side, and their weights. One step outside the lattice
/// stands the quadratic through the three cells beside it.
#[inline(always)]
fn taps(at: f64, side: usize) -> (usize, [f64; 4]) {
    let low = index(at).min(side - 2);
    let [a, b, c, d] = keys(at - number(low));
    match low {
        0 => (0, [b + 3.0 * a, c - 3.0 * a, d + a, 0.0]),
        low if low + 2 == side => (side - 4, [0.0, a + d, b - 3.0 * d, c + 3.0 * d]),
        low => (low - 1, [a, b, c, d]),
    }
}

/// The weights of four neighbours for a place at the share `t` of the way between the middle two.
#[inline(always)]
fn keys(t: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        0.5 * (-t3 + 2.0 * t2 - t),
        0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
        0.5 * (-3.0 * t3 + 4.0 * t2 + t),
        0.5 * (t3 - t2),
    ]
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "clamped to the lattice")]
#[expect(clippy::cast_sign_loss, reason = "clamped to the lattice")]
fn index(coordinate: f64) -> usize {
    coordinate as usize
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
        let (mut sum, mut mean, mut square) = (0.0, Vector2::zeros(), Matrix2::zeros());
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
        let (old, new) = (lattice(), lattice().with_side(5));
        let turned = Matrix2::new(0.6, -0.8, 0.8, 0.6);
        let new = new.moved(Vector2::new(4.0, -1.0), &turned).expect("it has an area");
        let (origin, steps) = new.in_coordinates_of(&old);
        for i in 0..new.len() {
            let at = origin + steps * Vector2::new(number(i % 5), number(i / 5));
            assert!((at - old.coordinates(&new.place(i))).norm() < 1e-12);
        }
    }

    #[test]
    fn a_quadratic_is_read_exactly_up_to_the_border() {
        let lattice = lattice();
        let quadratic =
            |p: &Vector2<f64>| 1.0 - 0.3 * p.x * p.x + p.x * p.y - 0.2 * p.y * p.y + p.y;
        let column: Vec<f64> = (0..lattice.len()).map(|i| quadratic(&lattice.place(i))).collect();
        for at in [[0.0, 0.0], [0.3, 0.4], [3.5, 7.9], [8.0, 8.0], [7.7, 0.2], [4.1, 4.9]] {
            let at = Vector2::from(at);
            let place = lattice.centre
                + lattice.half_sides
                    * ((at * 2.0 + Vector2::repeat(1.0)) / 9.0 - Vector2::repeat(1.0));
            let stencil = Stencil::at(&at, 9);
            for read in [stencil.read(&column, 9), stencil.read_log(&column, 9)] {
                let error = read - quadratic(&place);
                assert!(error.abs() < 1e-11, "off by {error} at {at}");
            }
        }
    }

    #[test]
    fn little_rises_beside_a_cliff() {
        let edge = |i: usize| if i % 9 > 4 { -400.0 } else { -0.1 * number(i / 9) };
        let column: Vec<f64> = (0..81).map(edge).collect();
        for i in 0..=160 {
            let stencil = Stencil::at(&Vector2::new(0.05 * f64::from(i), 3.4), 9);
            // Cubics rise by 30.
            let log = stencil.read_log(&column, 9);
            assert!(log < 0.125 * BEND, "{log} at {}", 0.05 * f64::from(i));
        }
    }

    #[test]
    fn what_is_impossible_beside_a_place_does_not_spread() {
        let mut column = [0.5; 81];
        column[40] = f64::NEG_INFINITY;
        for read in [Stencil::read, Stencil::read_log] {
            let read = |x, y| read(&Stencil::at(&Vector2::new(x, y), 9), &column, 9);
            assert!((read(3.2, 4.0) - 0.5).abs() < 1e-15);
            assert!(read(3.9, 4.1) <= f64::NEG_INFINITY);
        }
    }
}
