use alloc::{vec, vec::Vec};

use nalgebra::{Matrix2, Vector2};

use crate::{count::number, vectorised::Kernel};

/// A place among the cells of a lattice.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Place {
    /// The cell before it along both sides.
    before: usize,
    /// The share of the way to the next one, along either side.
    share: [f64; 2],
}

impl Place {
    /// Returns the place in a lattice with `side` cells to a side; `at` as from
    /// [`Lattice::coordinates`](super::Lattice::coordinates). A place outside is moved to the
    /// border.
    #[inline(always)]
    pub(super) fn at(at: &Vector2<f64>, side: usize) -> Self {
        let last = number(side - 1);
        let at = at.map(|c| c.clamp(0.0, last));
        let before = [at.x, at.y].map(|at| index(at).min(side - 2));
        Self {
            before: before[1] * side + before[0],
            share: [at.x - number(before[0]), at.y - number(before[1])],
        }
    }

    /// The nearest cell.
    pub(super) fn nearest(&self, side: usize) -> usize {
        let next = self.share.map(|share| usize::from(share >= 0.5));
        self.before + next[1] * side + next[0]
    }

    /// Returns the largest difference of the numbers of the 4 × 4 cells about it.
    pub(super) fn range(&self, column: &[f64], side: usize) -> f64 {
        let mut least = f64::INFINITY;
        let mut most = f64::NEG_INFINITY;
        for value in self.about(column, side).0.as_flattened() {
            (least, most) = (least.min(*value), most.max(*value));
        }
        most - least
    }

    /// A logarithm, which may fall off a cliff between two cells, as it does where all bearings
    /// meet: beside one, cubics overshoot by a share of its height.
    fn read_limited(&self, column: &[f64], side: usize) -> f64 {
        let (rows, behind) = self.about(column, side);
        let along = rows.map(|row| bent(row, behind[0], self.share[0]));
        let log = bent(along, behind[1], self.share[1]);
        if log.is_finite() { log } else { column[self.nearest(side)] }
    }

    /// The 4 × 4 cells about it, and behind which of the four it lies, along either side.
    fn about(&self, column: &[f64], side: usize) -> ([[f64; 4]; 4], [usize; 2]) {
        let before = [self.before % side, self.before / side];
        let first = before.map(|cell| cell.saturating_sub(1).min(side - 4));
        let row = |j| {
            let first = (first[1] + j) * side + first[0];
            core::array::from_fn(|i| column[first + i])
        };
        (core::array::from_fn(row), [before[0] - first[0], before[1] - first[1]])
    }
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "within the lattice")]
#[expect(clippy::cast_sign_loss, reason = "within the lattice")]
fn index(coordinate: f64) -> usize {
    coordinate as u32 as usize
}

/// Columns read between their cells by cubic convolution (Keys 1981): along either side on the two
/// parabolas through three cells each, weighted by their nearness. This is exact for quadratics,
/// the logarithms of Gaussians.
pub(super) struct Reading<'a, 'b> {
    /// Place of the first new cell, counted in old ones, and the steps to its neighbours.
    pub origin: Vector2<f64>,
    pub steps: Matrix2<f64>,
    /// Sides of the old and the new lattice, in cells.
    pub sides: [usize; 2],
    /// Logarithms, and where they go.
    pub logs: OldAndNew<'a, 'b>,
    /// All other columns.
    pub others: OldAndNew<'a, 'b>,
}

type OldAndNew<'a, 'b> = (&'a [&'b [f64]], &'a mut [&'b mut [f64]]);

impl Kernel for Reading<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { origin, steps, sides: [old, new], logs, others } = self;
        let mut places = vec![Place::default(); new * new];
        for (row, places) in places.chunks_exact_mut(new).enumerate() {
            let start = origin + steps.column(1) * number(row);
            for (along, place) in places.iter_mut().enumerate() {
                *place = Place::at(&(start + steps.column(0) * number(along)), old);
            }
        }
        let mut surface = Surface::new(old);
        let mut between = vec![Point::default(); new];
        for (out, column) in logs.1.iter_mut().zip(logs.0) {
            surface.fit(column);
            surface.read(column, &places, &mut between, out);
            surface.limit(column, &places, out);
        }
        for (out, column) in others.1.iter_mut().zip(others.0) {
            surface.fit(column);
            surface.read(column, &places, &mut between, out);
        }
    }
}

/// A column in a cell or between cells, its bends (second differences from cell to cell) along
/// either side, and the bend along the first of that along the second: as wide as a vector.
type Point = [f64; 4];

/// A column and its bends.
struct Surface {
    side: usize,
    points: Vec<Point>,
    bends: [Vec<f64>; 3],
}

impl Surface {
    #[inline(always)]
    fn new(side: usize) -> Self {
        Self {
            side,
            points: vec![Point::default(); side * side],
            bends: core::array::from_fn(|_| vec![0.0; side * side]),
        }
    }

    /// Becomes that of a column.
    #[inline(always)]
    fn fit(&mut self, column: &[f64]) {
        let Self { side, points, bends: [x, y, both] } = self;
        bend(column, *side, [1, *side], x);
        bend(column, *side, [*side, 1], y);
        bend(y, *side, [1, *side], both);
        let columns = column.iter().zip(x).zip(y).zip(both);
        for (point, (((value, x), y), both)) in points.iter_mut().zip(columns) {
            *point = [*value, *x, *y, *both];
        }
    }

    /// Reads the column. Where a number that is taken is infinite, the nearest cell's.
    #[inline(always)]
    fn read(&self, column: &[f64], places: &[Place], between: &mut [Point], out: &mut [f64]) {
        let rows = out.chunks_exact_mut(between.len());
        for (out, places) in rows.zip(places.chunks_exact(between.len())) {
            for (point, place) in between.iter_mut().zip(places) {
                let ([a, b], [c, d]) = (self.two(place.before), self.two(place.before + self.side));
                let [x, y] = place.share;
                *point = on_the_way(&on_the_way(a, c, y), &on_the_way(b, d, y), x);
            }
            for ((out, [value, bend_x, bend_y, both]), place) in
                out.iter_mut().zip(&*between).zip(places)
            {
                let [x, y] = place.share.map(|share| 0.5 * share * (1.0 - share));
                *out = (value - (x * bend_x + y * bend_y)) + x * y * both;
            }
            if !out.iter().fold(true, |finite, value| finite & value.is_finite()) {
                for (out, place) in out.iter_mut().zip(places) {
                    if !out.is_finite() {
                        *out = column[place.nearest(self.side)];
                    }
                }
            }
        }
    }

    /// Reads the column as a logarithm where one of the bends that are taken may be beyond its
    /// limit. Elsewhere it has been read.
    #[inline(always)]
    fn limit(&self, column: &[f64], places: &[Place], out: &mut [f64]) {
        // NaN and infinite ones, beside an infinite number, are steep as well.
        let steep = |bend: &f64| bend.is_nan() | (bend.abs() > STEEP);
        if !self.bends[..2].iter().any(|b| b.iter().fold(false, |any, b| any | steep(b))) {
            return;
        }
        let mut takes_one = vec![false; column.len()];
        let side = self.side;
        let bends = self.bends[0].iter().zip(&self.bends[1]);
        for (cell, _) in bends.enumerate().filter(|(_, (x, y))| steep(x) || steep(y)) {
            let [x, y] = [cell % side, cell / side];
            for row in y.saturating_sub(2)..(y + 2).min(side) {
                takes_one[row * side..][x.saturating_sub(2)..(x + 2).min(side)].fill(true);
            }
        }
        for (out, place) in out.iter_mut().zip(places) {
            if takes_one[place.before] {
                *out = place.read_limited(column, side);
            }
        }
    }

    /// The points in a cell and the next one.
    #[inline(always)]
    fn two(&self, first: usize) -> [&Point; 2] {
        let two = &self.points[first..first + 2];
        [&two[0], &two[1]]
    }
}

/// The bends of a square column from cell to cell along one side; the other numbers are the
/// steps to the next cell along it and across it.
#[inline(always)]
fn bend(column: &[f64], side: usize, [along, across]: [usize; 2], out: &mut [f64]) {
    let count = column.len() - 2 * along;
    let before = &column[..count];
    let after = &column[2 * along..];
    let cells = column[along..].iter().zip(before).zip(after);
    for (out, ((at, before), after)) in out[along..].iter_mut().zip(cells) {
        *out = (before - at) + (after - at);
    }
    // One step outside stands the quadratic through the last three cells of a line.
    for line in 0..side {
        let first = line * across;
        let last = line * across + (side - 1) * along;
        (out[first], out[last]) = (out[first + along], out[last - along]);
    }
}

#[inline(always)]
fn on_the_way(from: &Point, to: &Point, share: f64) -> Point {
    core::array::from_fn(|i| from[i] + share * (to[i] - from[i]))
}

/// Logarithms that are bent by no more than this from cell to cell are read as they are: it makes
/// an eighth of it between them, where bearings of a hunt are bent by hundreds.
const BEND: f64 = 20.0;

/// Bend of the cells up to which the curve between them is bent by no more than [`BEND`]: the
/// weights of cubic convolution have magnitudes of up to 1.25 together.
const STEEP: f64 = BEND / 1.25;

/// Returns the value behind one of four neighbours, at the share `t` of the way to the next: on the
/// two parabolas through three of them, weighted by their nearness; but bent no more than twice
/// what either of the two is, or [`BEND`].
fn bent(four: [f64; 4], behind: usize, t: f64) -> f64 {
    let [a, b, c, d] = match behind {
        0 => [3.0 * (four[0] - four[1]) + four[2], four[0], four[1], four[2]],
        2 => [four[1], four[2], four[3], 3.0 * (four[3] - four[2]) + four[1]],
        _ => four,
    };
    let before = (a - b) + (c - b);
    let after = (b - c) + (d - c);
    let least = if before * after > 0.0 { before.abs().min(after.abs()) } else { 0.0 };
    let most = (2.0 * least).max(BEND);
    let bend = ((1.0 - t) * before + t * after).clamp(-most, most);
    b + t * (c - b) - 0.5 * t * (1.0 - t) * bend
}

#[cfg(test)]
mod tests {
    use crate::vectorised::run;
    use approx::{abs_diff_eq, assert_abs_diff_eq};

    use super::*;

    /// A column of 9 × 9 cells at a place, as any column and as a logarithm.
    fn read(at: Vector2<f64>, column: &[f64]) -> [f64; 2] {
        let mut any = [0.0];
        let mut log = [0.0];
        run(Reading {
            origin: at,
            steps: Matrix2::zeros(),
            sides: [9, 1],
            logs: (&[column], &mut [&mut log]),
            others: (&[column], &mut [&mut any]),
        });
        [any[0], log[0]]
    }

    #[test]
    fn a_quadratic_is_read_exactly_up_to_the_border() {
        let quadratic = |x: f64, y: f64| 1.0 - 0.3 * x * x + x * y - 0.2 * y * y + y;
        let column: Vec<f64> = (0..81).map(|i| quadratic(number(i % 9), number(i / 9))).collect();
        for [x, y] in [[0.0, 0.0], [0.3, 0.4], [3.5, 7.9], [8.0, 8.0], [7.7, 0.2], [4.1, 4.9]] {
            for read in read(Vector2::new(x, y), &column) {
                let error = read - quadratic(x, y);
                assert!(abs_diff_eq!(error, 0.0, epsilon = 1e-11), "off by {error} at {x}, {y}");
            }
        }
    }

    #[test]
    fn a_curve_is_bent_alike_upwards_and_downwards() {
        for four in [[0.0, 0.0, 90.0, 400.0], [3.0, -70.0, 20.0, 900.0], [0.0, 50.0, 500.0, 960.0]]
        {
            for behind in 0..3 {
                let up = bent(four, behind, 0.4);
                let down = bent(four.map(|value: f64| -value), behind, 0.4);
                assert_abs_diff_eq!(up, -down, epsilon = 1e-12);
            }
        }
    }

    #[test]
    fn all_columns_are_read_in_all_rows() {
        let column = |factor: f64| -> Vec<f64> { (0..81).map(|i| factor * number(i)).collect() };
        let old: Vec<Vec<f64>> = [1.0, 2.0, 3.0, 4.0].into_iter().map(column).collect();
        let mut new = vec![vec![0.0; 49]; 4];
        let (old, mut new_mut): (Vec<&[f64]>, Vec<&mut [f64]>) =
            old.iter().zip(&mut new).map(|(old, new)| (&old[..], &mut new[..])).unzip();
        let origin = Vector2::new(1.0, 0.5);
        let steps = Matrix2::new(0.75, 0.25, -0.05, 1.1);
        let (logs, others) = new_mut.split_at_mut(2);
        run(Reading {
            origin,
            steps,
            sides: [9, 7],
            logs: (&old[..2], logs),
            others: (&old[2..], others),
        });
        for (factor, new) in [1.0, 2.0, 3.0, 4.0].into_iter().zip(&new) {
            for (i, value) in new.iter().enumerate() {
                let at = origin + steps * Vector2::new(number(i % 7), number(i / 7));
                let expected = factor * (at.x + 9.0 * at.y);
                assert_abs_diff_eq!(*value, expected, epsilon = 1e-12 * 81.0);
            }
        }
    }

    #[test]
    fn little_rises_beside_a_cliff() {
        let edge = |i: usize| if i % 9 > 4 { -400.0 } else { -0.1 * number(i / 9) };
        let column: Vec<f64> = (0..81).map(edge).collect();
        let highest = |which: usize| {
            let places = (0..=160).map(|i| Vector2::new(0.05 * f64::from(i), 3.4));
            places.map(|at| read(at, &column)[which]).fold(f64::NEG_INFINITY, f64::max)
        };
        let cubic = highest(0);
        let log = highest(1);
        assert!(cubic > 25.0 && log < 0.125 * BEND, "{cubic}, {log}");
    }

    #[test]
    fn bends_are_limited_wherever_one_is_beyond_its_limit() {
        // Waves of all sizes, with a cliff.
        let wave = |i: usize| {
            let x = number(i % 9);
            let y = number(i / 9);
            x * y * libm::sin(2.0 * x + 3.0 * y) - if x + y > 13.0 { 200.0 } else { 0.0 }
        };
        let column: Vec<f64> = (0..81).map(wave).collect();
        let mut limited = 0;
        for i in 0..1600 {
            let at = Vector2::new(0.2 * number(i % 40), 0.2 * number(i / 40)).add_scalar(0.07);
            let exact = Place::at(&at, 9).read_limited(&column, 9);
            let [any, log] = read(at, &column);
            assert!(abs_diff_eq!(log, exact, epsilon = 1e-10), "{log} for {exact} at {at}");
            limited += usize::from((any - exact).abs() > 1e-10);
        }
        assert!((200..1400).contains(&limited), "{limited}");
    }

    #[test]
    fn what_is_impossible_beside_a_place_does_not_spread() {
        let mut column = [0.5; 81];
        column[40] = f64::NEG_INFINITY;
        for value in read(Vector2::new(3.2, 4.0), &column) {
            assert_abs_diff_eq!(value, 0.5, epsilon = 1e-15);
        }
        for value in read(Vector2::new(3.9, 4.1), &column) {
            assert!(value <= f64::NEG_INFINITY);
        }
    }
}
