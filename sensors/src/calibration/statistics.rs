//! Statistics that calibrations share: Student's t, correlation, and what harmonics leave of
//! levels.

use nalgebra::{SMatrix, SVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Harmonics of the boresight in a pattern in dB.
const HARMONICS: u8 = 4;

/// Numbers of a pattern of four harmonics: its mean, and sine and cosine of each harmonic.
pub const HARMONIC_PATTERN_UNKNOWNS: usize = 9;

/// Pearson's correlation of two series, and how likely it is by chance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correlation {
    /// The coefficient r, in [−1, 1] (Pritzl 2018, eq. 4.3).
    pub coefficient: f64,
    /// The probability of one as large if there were none, by Student's t with n − 2 degrees of
    /// freedom, on both sides.
    pub p_value: f64,
}

impl Correlation {
    /// The correlation of pairs; `None` for less than three, or where one of the two does not vary.
    #[must_use]
    pub fn of(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> Option<Self> {
        let sum = |of: &dyn Fn(f64, f64) -> f64| pairs.clone().map(|(x, y)| of(x, y)).sum::<f64>();
        let points = sum(&|_, _| 1.0);
        let mean_x = sum(&|x, _| x) / points;
        let mean_y = sum(&|_, y| y) / points;
        let square_x = sum(&|x, _| (x - mean_x) * (x - mean_x));
        let square_y = sum(&|_, y| (y - mean_y) * (y - mean_y));
        // Rounding makes equal numbers differ by this much of themselves.
        let varies = |square: f64, mean: f64| square > 1e-24 * mean * mean;
        if points < 3.0 || !varies(square_x, mean_x) || !varies(square_y, mean_y) {
            return None;
        }
        let product = sum(&|x, y| (x - mean_x) * (y - mean_y));
        let coefficient = (product / libm::sqrt(square_x * square_y)).clamp(-1.0, 1.0);
        Some(Self { coefficient, p_value: p_value(coefficient, points)? })
    }
}

/// Number of standard errors to either side that hold the value with `probability`, for an error
/// with `freedom` degrees of freedom; `None` when `probability` is not in (0, 1).
pub(super) fn quantile(freedom: f64, probability: f64) -> Option<f64> {
    if !(probability > 0.0 && probability < 1.0) {
        return None;
    }
    let law = StudentsT::new(0.0, 1.0, freedom).ok()?;
    Some(law.inverse_cdf(0.5 + 0.5 * probability))
}

/// The probability that a Student's t with `freedom` degrees of freedom lies beyond ±`t`.
fn two_sided(freedom: f64, t: f64) -> Option<f64> {
    let law = StudentsT::new(0.0, 1.0, freedom).ok()?;
    Some(2.0 * law.cdf(-libm::fabs(t)))
}

fn p_value(r: f64, points: f64) -> Option<f64> {
    let freedom = points - 2.0;
    let t = r * libm::sqrt(freedom / (1.0 - r * r).max(f64::MIN_POSITIVE));
    two_sided(freedom, t)
}

/// The sum of squares in dB² that the best pattern of four harmonics leaves of levels in dB, each
/// at a boresight in radians; infinite where no pattern can be fitted.
///
/// Levels and boresights belong together in their order; the rest of the longer list does not
/// count.
#[must_use]
pub fn unexplained_by_harmonics(levels_db: &[f64], boresights: &[f64]) -> f64 {
    const UNKNOWNS: usize = HARMONIC_PATTERN_UNKNOWNS;
    // Boresights that leave a harmonic open leave it at none.
    let mut normal = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::identity() * 1e-6;
    let mut right = SVector::<f64, UNKNOWNS>::zeros();
    #[expect(clippy::cast_precision_loss, reason = "pulses of a flight")]
    let mean = levels_db.iter().sum::<f64>() / levels_db.len() as f64;
    let rows = || levels_db.iter().zip(boresights).map(|(level, at)| (level - mean, row(*at)));
    for (level, row) in rows() {
        normal.ger(1.0, &row, &row, 1.0);
        right.axpy(level, &row, 1.0);
    }
    let Some(factor) = normal.cholesky() else { return f64::INFINITY };
    let pattern = factor.solve(&right);
    let left = rows().map(|(level, row)| level - row.dot(&pattern));
    left.map(|left| left * left).sum()
}

/// The mean and the harmonics at a boresight.
fn row(boresight: f64) -> SVector<f64, HARMONIC_PATTERN_UNKNOWNS> {
    let harmonics = (1..=HARMONICS).flat_map(|order| {
        let (sin, cos) = libm::sincos(f64::from(order) * boresight);
        [sin, cos]
    });
    SVector::from_iterator(core::iter::once(1.0).chain(harmonics))
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use std::vec::Vec;

    use super::*;

    /// Abramowitz & Stegun 1964, table 26.10.
    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (freedom, probability, expected) in
            [(1.0, 0.95, 12.706), (10.0, 0.95, 2.228), (30.0, 0.99, 2.750), (4.0, 0.9, 2.132)]
        {
            let t = quantile(freedom, probability).expect("proper");
            assert_abs_diff_eq!(t, expected, epsilon = 1e-3);
            let p = two_sided(freedom, -t).expect("proper");
            assert_abs_diff_eq!(p, 1.0 - probability, epsilon = 1e-6);
        }
        assert_eq!(quantile(5.0, 1.0), None);
    }

    /// Pritzl 2018, §7.2: r = 0.713 on 15 points has p = 0.0028.
    #[test]
    fn it_has_the_published_probability() {
        let p = p_value(0.713, 15.0).expect("enough points");
        assert_abs_diff_eq!(p, 0.0028, epsilon = 1e-4);
    }

    #[test]
    fn it_is_that_of_the_pairs() {
        let of = |y: [f64; 5]| Correlation::of([1.0, 2.0, 3.0, 4.0, 5.0].into_iter().zip(y));
        let Correlation { coefficient, p_value } = of([1.1, 1.9, 3.2, 3.9, 5.1]).expect("varies");
        assert!(coefficient > 0.99 && p_value < 0.001, "{coefficient} {p_value}");
        let Correlation { coefficient, p_value } = of([1.0, -1.0, 0.0, -1.0, 1.0]).expect("varies");
        assert_abs_diff_eq!(coefficient, 0.0, epsilon = 1e-12);
        assert_abs_diff_eq!(p_value, 1.0, epsilon = 1e-9);
        assert_eq!(of([0.1; 5]), None);
        assert_eq!(Correlation::of([(1.0, 2.0), (2.0, 1.0)].into_iter()), None);
    }

    extern crate std;

    #[test]
    fn leaves_nothing_of_a_pattern_and_all_of_a_fifth_harmonic() {
        let boresights: Vec<f64> = (0..40).map(|i| 0.157 * f64::from(i)).collect();
        let of = |level: fn(f64) -> f64| boresights.iter().map(|at| level(*at)).collect::<Vec<_>>();
        let pattern = of(|at| 3.0 + 2.0 * at.cos() - (4.0 * at).sin());
        assert!(unexplained_by_harmonics(&pattern, &boresights) < 1e-6);
        let fifth = of(|at| (5.0 * at).cos());
        let left = unexplained_by_harmonics(&fifth, &boresights);
        assert_abs_diff_eq!(left, 20.0, epsilon = 0.5);
    }
}
