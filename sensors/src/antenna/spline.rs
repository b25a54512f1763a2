use alloc::vec::Vec;
use core::f64::consts::TAU;

use foxhunt_core::angle;

/// A cubic spline through values over a full turn, with continuous first and second derivatives
/// everywhere, across the ends too (de Boor 2001, ch. IV: the periodic end conditions).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PeriodicSpline {
    /// The first value's angle.
    origin: f64,
    /// One from each value to the next, the last one to the first.
    pieces: Vec<Piece>,
}

/// One piece: where it begins after the first value's angle, increasing from 0, below a turn; and
/// the factors of the powers of the angle from there on, the first of which is the value.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    from: f64,
    factors: [f64; 4],
}

impl Piece {
    /// The cubic at an angle after its beginning.
    #[inline]
    fn at(&self, along: f64) -> f64 {
        let [value, slope, bend, twist] = self.factors;
        (value + along * slope) + along * along * (bend + along * twist)
    }

    /// Returns the derivative of the cubic at an angle after its beginning.
    #[inline]
    fn slope(&self, along: f64) -> f64 {
        let [_, slope, bend, twist] = self.factors;
        slope + along * (2.0 * bend + 3.0 * along * twist)
    }
}

impl PeriodicSpline {
    /// Through at least three rows of increasing angles in radians that span less than a turn.
    pub(super) fn new(rows: &[(f64, f64)]) -> Self {
        let origin = rows[0].0;
        let next = |i: usize| if i + 1 < rows.len() { i + 1 } else { 0 };
        let end = |i: usize| rows.get(i + 1).map_or(TAU, |(angle, _)| angle - origin);
        let length: Vec<f64> = (0..rows.len()).map(|i| end(i) - (rows[i].0 - origin)).collect();
        let slope = |i: usize| (rows[next(i)].1 - rows[i].1) / length[i];
        let slope: Vec<f64> = (0..rows.len()).map(slope).collect();
        let curvatures = curvatures(&length, &slope);
        let piece = |(i, &(angle, value)): (usize, &(f64, f64))| {
            // Press et al. 2007, eq. 3.3.3, by powers.
            let begin = curvatures[i];
            let change = curvatures[next(i)] - curvatures[i];
            let along = slope[i] - length[i] * (3.0 * begin + change) / 6.0;
            let factors = [value, along, 0.5 * begin, change / (6.0 * length[i])];
            Piece { from: angle - origin, factors }
        };
        Self { origin, pieces: rows.iter().enumerate().map(piece).collect() }
    }

    pub(super) fn values(&self) -> impl Iterator<Item = f64> {
        self.pieces.iter().map(|piece| piece.factors[0])
    }

    /// Angles of the rows, in radians.
    pub(super) fn angles(&self) -> impl Iterator<Item = f64> {
        self.pieces.iter().map(|piece| self.origin + piece.from)
    }

    #[inline]
    pub(super) fn at(&self, angle: f64) -> f64 {
        let (piece, along) = self.locate(angle);
        piece.at(along)
    }

    /// The derivative per radian.
    pub(super) fn slope(&self, angle: f64) -> f64 {
        let (piece, along) = self.locate(angle);
        piece.slope(along)
    }

    /// The mean of a function of the spline's values over the turn, by two-point Gauss quadrature
    /// in each piece: exact for the spline itself.
    pub(super) fn mean(&self, of: impl Fn(f64) -> f64) -> f64 {
        let node = 0.5 - 0.5 / libm::sqrt(3.0);
        let ends = self.pieces.iter().skip(1).map(|piece| piece.from).chain([TAU]);
        let strip = |(piece, end): (&Piece, f64)| {
            let length = end - piece.from;
            0.5 * length * (of(piece.at(node * length)) + of(piece.at((1.0 - node) * length)))
        };
        self.pieces.iter().zip(ends).map(strip).sum::<f64>() / TAU
    }

    /// The piece that holds `angle`, and the angle's distance from its beginning.
    #[inline]
    fn locate(&self, angle: f64) -> (&Piece, f64) {
        let wrapped = angle::wrap(angle - self.origin);
        let offset = if wrapped < 0.0 { wrapped + TAU } else { wrapped };
        let piece = &self.pieces[self.row_before(offset)];
        (piece, offset - piece.from)
    }

    /// The last row that is not after an offset from the first one.
    #[inline]
    fn row_before(&self, offset: f64) -> usize {
        // Most tables have equal steps.
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "a guess, which is looked at"
        )]
        let guess = (offset * (self.pieces.len() as f64 / TAU)) as usize;
        let is_after = |row: usize| self.pieces.get(row).is_none_or(|piece| piece.from > offset);
        if !is_after(guess) && is_after(guess + 1) {
            return guess;
        }
        self.pieces.partition_point(|piece| piece.from <= offset).saturating_sub(1)
    }
}

/// The second derivatives at the rows, from the pieces' lengths and mean slopes: a cyclic
/// tridiagonal system, by a correction of rank one (Press et al. 2007, §2.7.2). Its diagonal
/// dominates, so nothing has to be pivoted.
fn curvatures(length: &[f64], slope: &[f64]) -> Vec<f64> {
    let rows = length.len();
    let last = rows - 1;
    let before = |i: usize| if i == 0 { last } else { i - 1 };
    let mut diagonal: Vec<f64> = (0..rows).map(|i| 2.0 * (length[before(i)] + length[i])).collect();
    let mut right: Vec<f64> = (0..rows).map(|i| 6.0 * (slope[i] - slope[before(i)])).collect();
    // The corner c couples the first unknown with the last: A = T + u vᵀ with u = (γ, 0, …, c) and
    // v = (1, 0, …, c/γ).
    let corner = length[last];
    let gamma = -diagonal[0];
    diagonal[0] -= gamma;
    diagonal[last] -= corner * corner / gamma;
    let mut along = alloc::vec![0.0; rows];
    (along[0], along[last]) = (gamma, corner);
    for i in 1..rows {
        let factor = length[i - 1] / diagonal[i - 1];
        diagonal[i] -= factor * length[i - 1];
        right[i] -= factor * right[i - 1];
        along[i] -= factor * along[i - 1];
    }
    for i in (0..rows).rev() {
        let (coupling, [beyond, more]) =
            if i < last { (length[i], [right[i + 1], along[i + 1]]) } else { (0.0, [0.0; 2]) };
        right[i] = (right[i] - coupling * beyond) / diagonal[i];
        along[i] = (along[i] - coupling * more) / diagonal[i];
    }
    let through = |x: &[f64]| x[0] + x[last] * corner / gamma;
    let share = through(&right) / (1.0 + through(&along));
    right.iter().zip(&along).map(|(x, z)| x - share * z).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::{abs_diff_eq, assert_abs_diff_eq};

    fn rows() -> Vec<(f64, f64)> {
        let gains = [3.0, -7.0, 2.5, 0.0, -40.0, 1.0, 8.0];
        let angles = [-1.0, -0.2, 0.3, 1.7, 1.9, 3.0, 4.5];
        angles.into_iter().zip(gains).collect()
    }

    /// A cubic in each piece with these properties is the spline, and no other is.
    #[test]
    fn it_goes_through_its_rows_with_two_continuous_derivatives() {
        let spline = PeriodicSpline::new(&rows());
        for (i, (angle, value)) in rows().into_iter().enumerate() {
            assert_abs_diff_eq!(spline.at(angle), value, epsilon = 1e-12);
            let after = spline.pieces[i];
            let before = spline.pieces[(i + 6) % 7];
            let end = if i == 0 { TAU } else { after.from };
            let slope = before.slope(end - before.from);
            assert!(abs_diff_eq!(slope, after.slope(0.0), epsilon = 1e-10), "at row {i}");
            // Second derivatives by differences: of a cubic they are exact but for rounding.
            let step = 1e-3;
            let curve = |middle: f64| {
                let at = |d: f64| spline.at(middle + d);
                (at(step) - 2.0 * at(0.0) + at(-step)) / (step * step)
            };
            let aside =
                |side: f64| 2.0 * curve(angle + side * step) - curve(angle + 2.0 * side * step);
            assert!(abs_diff_eq!(aside(1.0), aside(-1.0), epsilon = 1e-4), "at row {i}");
        }
    }

    /// The error of a spline through f at equal steps h is at most 5 h⁴ max |f⁗| / 384 (Hall 1968).
    #[test]
    fn a_cosine_through_36_rows_errs_within_the_bound() {
        let step = TAU / 36.0;
        let rows: Vec<_> =
            (0..36_u16).map(|i| (f64::from(i) * step, libm::cos(f64::from(i) * step))).collect();
        let spline = PeriodicSpline::new(&rows);
        let bound = 5.0 * step.powi(4) / 384.0;
        for i in 0..1000_u16 {
            let angle = f64::from(i) * 0.0157 - 7.0;
            let error = (spline.at(angle) - libm::cos(angle)).abs();
            assert!(error < bound, "{error} at {angle}, the bound is {bound}");
        }
    }

    #[test]
    fn its_mean_is_exact() {
        let spline = PeriodicSpline::new(&rows());
        let sum: f64 = (0..100_000_u32).map(|i| spline.at(f64::from(i) * TAU / 100_000.0)).sum();
        assert_abs_diff_eq!(spline.mean(|value| value), sum / 100_000.0, epsilon = 1e-6);
    }
}
