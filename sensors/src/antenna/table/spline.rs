use alloc::vec::Vec;
use core::f64::consts::TAU;

use foxhunt_core::angle;

/// A cubic spline through values over a full turn, with continuous first and second derivatives
/// everywhere, across the ends too (de Boor 2001, ch. IV: the periodic end conditions).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PeriodicSpline {
    /// The first value's angle.
    origin: f64,
    /// Each value's angle after the first one's, increasing from 0, below a turn.
    offsets: Vec<f64>,
    values: Vec<f64>,
    /// The second derivative at each value.
    curvatures: Vec<f64>,
}

/// One piece: where it begins, how long it is, values and second derivatives at its ends.
struct Piece {
    from: f64,
    length: f64,
    values: [f64; 2],
    curvatures: [f64; 2],
}

impl Piece {
    /// The cubic at the share `b` of the piece (Press et al. 2007, eq. 3.3.3).
    fn at(&self, b: f64) -> f64 {
        let a = 1.0 - b;
        let bend = (a * a * a - a) * self.curvatures[0] + (b * b * b - b) * self.curvatures[1];
        a * self.values[0] + b * self.values[1] + bend * self.length * self.length / 6.0
    }

    /// Its derivative there (eq. 3.3.5).
    fn slope(&self, b: f64) -> f64 {
        let a = 1.0 - b;
        let bend =
            (3.0 * b * b - 1.0) * self.curvatures[1] - (3.0 * a * a - 1.0) * self.curvatures[0];
        (self.values[1] - self.values[0]) / self.length + bend * self.length / 6.0
    }
}

impl PeriodicSpline {
    /// Through at least three rows of increasing angles in radians that span less than a turn.
    pub(super) fn new(rows: &[(f64, f64)]) -> Self {
        let origin = rows[0].0;
        let (offsets, values): (Vec<_>, Vec<_>) =
            rows.iter().map(|(angle, value)| (angle - origin, *value)).unzip();
        let mut spline = Self { origin, offsets, values, curvatures: Vec::new() };
        spline.curvatures = spline.solve();
        spline
    }

    pub(super) fn values(&self) -> &[f64] {
        &self.values
    }

    /// Where the rows lie, in radians.
    pub(super) fn angles(&self) -> impl Iterator<Item = f64> {
        self.offsets.iter().map(|offset| self.origin + offset)
    }

    pub(super) fn at(&self, angle: f64) -> f64 {
        let (piece, share) = self.locate(angle);
        piece.at(share)
    }

    /// The derivative per radian.
    pub(super) fn slope(&self, angle: f64) -> f64 {
        let (piece, share) = self.locate(angle);
        piece.slope(share)
    }

    /// The mean of a function of the spline's values over the turn, by two-point Gauss quadrature
    /// in each piece: exact for the spline itself.
    pub(super) fn mean(&self, of: impl Fn(f64) -> f64) -> f64 {
        let node = 0.5 - 0.5 / libm::sqrt(3.0);
        let strip = |i| {
            let piece = self.piece(i);
            0.5 * piece.length * (of(piece.at(node)) + of(piece.at(1.0 - node)))
        };
        (0..self.values.len()).map(strip).sum::<f64>() / TAU
    }

    /// The piece that holds `angle`, and the share of it that lies before.
    fn locate(&self, angle: f64) -> (Piece, f64) {
        let wrapped = angle::wrap(angle - self.origin);
        let offset = if wrapped < 0.0 { wrapped + TAU } else { wrapped };
        let piece = self.piece(self.row_before(offset));
        let share = (offset - piece.from) / piece.length;
        (piece, share)
    }

    /// The last row that is not after an offset from the first one.
    fn row_before(&self, offset: f64) -> usize {
        // Most tables have equal steps.
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "a guess, which is looked at"
        )]
        let guess = (offset * (self.offsets.len() as f64 / TAU)) as usize;
        let is_after = |row: usize| self.offsets.get(row).is_none_or(|o| *o > offset);
        if !is_after(guess) && is_after(guess + 1) {
            return guess;
        }
        self.offsets.partition_point(|&o| o <= offset).saturating_sub(1)
    }

    /// The piece after row `i`.
    fn piece(&self, i: usize) -> Piece {
        let next = if i + 1 < self.values.len() { i + 1 } else { 0 };
        // Before the solution there is none to look at.
        let curvature = |i: usize| self.curvatures.get(i).copied().unwrap_or(0.0);
        Piece {
            from: self.offsets[i],
            length: self.offsets.get(i + 1).unwrap_or(&TAU) - self.offsets[i],
            values: [self.values[i], self.values[next]],
            curvatures: [curvature(i), curvature(next)],
        }
    }

    /// The second derivatives: a cyclic tridiagonal system, by a correction of rank one (Press et
    /// al. 2007, §2.7.2). Its diagonal dominates, so nothing has to be pivoted.
    fn solve(&self) -> Vec<f64> {
        let rows = self.values.len();
        let last = rows - 1;
        let length: Vec<f64> = (0..rows).map(|i| self.piece(i).length).collect();
        let slope: Vec<f64> = (0..rows).map(|i| self.piece(i).slope(0.5)).collect();
        let before = |i: usize| if i == 0 { last } else { i - 1 };
        let mut diagonal: Vec<f64> =
            (0..rows).map(|i| 2.0 * (length[before(i)] + length[i])).collect();
        let mut right: Vec<f64> = (0..rows).map(|i| 6.0 * (slope[i] - slope[before(i)])).collect();
        // The corner c couples the first unknown with the last: A = T + u vᵀ with u = (γ, 0, …, c)
        // and v = (1, 0, …, c/γ).
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
}

#[cfg(test)]
mod tests {
    use super::*;

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
            assert!((spline.at(angle) - value).abs() < 1e-12);
            let (after, before) = (spline.piece(i), spline.piece((i + 6) % 7));
            assert!((before.slope(1.0) - after.slope(0.0)).abs() < 1e-10, "at row {i}");
            // Second derivatives by differences: of a cubic they are exact but for rounding.
            let step = 1e-3;
            let curve = |middle: f64| {
                let at = |d: f64| spline.at(middle + d);
                (at(step) - 2.0 * at(0.0) + at(-step)) / (step * step)
            };
            let aside =
                |side: f64| 2.0 * curve(angle + side * step) - curve(angle + 2.0 * side * step);
            assert!((aside(1.0) - aside(-1.0)).abs() < 1e-4, "at row {i}");
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
        assert!((spline.mean(|value| value) - sum / 100_000.0).abs() < 1e-6);
    }
}
