use alloc::vec::Vec;

use foxhunt_core::{EstimatorError, parameter::require};
use nalgebra::{LU, Matrix2, U2, Vector2};

use crate::count::number;

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
        Ok(Self { centre, half_sides, factor: half_sides.lu(), side })
    }

    /// The same rectangle in other cells.
    pub(super) fn with_side(&self, side: usize) -> Self {
        Self { side, ..self.clone() }
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
        let along = |i: usize| (2.0 * number(i) + 1.0) / number(self.side) - 1.0;
        let at = Vector2::new(along(index % self.side), along(index / self.side));
        self.centre + self.half_sides * at
    }

    /// The centres of all cells, East and North as columns.
    pub(super) fn places(&self) -> [Vec<f64>; 2] {
        let along = |i: usize| (2.0 * number(i) + 1.0) / number(self.side) - 1.0;
        let along: Vec<f64> = (0..self.side).map(along).collect();
        [0, 1].map(|axis| {
            let (half, centre) = (self.half_sides.row(axis), self.centre[axis]);
            let mut places = Vec::with_capacity(self.len());
            for y in &along {
                places.extend(along.iter().map(|x| centre + (half[0] * x + half[1] * y)));
            }
            places
        })
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

    /// How a column over the cells is read at a place; `at` as from
    /// [`coordinates`](Self::coordinates). Outside, what stands on the border.
    pub(super) fn stencil(&self, at: &Vector2<f64>) -> Stencil {
        let last = number(self.side - 1);
        let at = at.map(|c| c.clamp(0.0, last));
        let nearest = at.map(libm::round);
        let ((x, weights_x), (y, weights_y)) = (taps(at.x, self.side), taps(at.y, self.side));
        Stencil {
            first: y * self.side + x,
            nearest: index(nearest.y) * self.side + index(nearest.x),
            weights_x,
            weights_y,
        }
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
}

impl Stencil {
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

/// The first of four neighbours along a side, and their weights. One step outside the lattice
/// stands the quadratic through the three cells beside it.
fn taps(at: f64, side: usize) -> (usize, [f64; 4]) {
    let low = libm::floor(at).min(number(side - 2));
    let [a, b, c, d] = keys(at - low);
    match index(low) {
        0 => (0, [b + 3.0 * a, c - 3.0 * a, d + a, 0.0]),
        low if low + 2 == side => (side - 4, [0.0, a + d, b - 3.0 * d, c + 3.0 * d]),
        low => (low - 1, [a, b, c, d]),
    }
}

/// The weights of four neighbours for a place at the share `t` of the way between the middle two.
fn keys(t: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        0.5 * (-t3 + 2.0 * t2 - t),
        0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
        0.5 * (-3.0 * t3 + 4.0 * t2 + t),
        0.5 * (t3 - t2),
    ]
}

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
            let error = lattice.stencil(&at).read(&column, 9) - quadratic(&place);
            assert!(error.abs() < 1e-11, "off by {error} at {at}");
        }
    }

    #[test]
    fn what_is_impossible_beside_a_place_does_not_spread() {
        let lattice = lattice();
        let mut column = [0.5; 81];
        column[40] = f64::NEG_INFINITY;
        let read = |x, y| lattice.stencil(&Vector2::new(x, y)).read(&column, 9);
        assert!((read(3.2, 4.0) - 0.5).abs() < 1e-15);
        assert!(read(3.9, 4.1) <= f64::NEG_INFINITY);
    }
}
