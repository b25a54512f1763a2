use nalgebra::{SMatrix, SVector};

/// Harmonics of the boresight in a pattern in dB.
const HARMONICS: u8 = 4;

/// Numbers of a pattern of four harmonics: its mean, and sine and cosine of each harmonic.
pub const HARMONIC_PATTERN_UNKNOWNS: usize = 9;

/// The sum of squares in dB² that the best pattern of four harmonics leaves of levels in dB, each at
/// a boresight in radians; infinite where no pattern can be fitted.
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
    extern crate std;

    use std::vec::Vec;

    use super::*;

    #[test]
    fn leaves_nothing_of_a_pattern_and_all_of_a_fifth_harmonic() {
        let boresights: Vec<f64> = (0..40).map(|i| 0.157 * f64::from(i)).collect();
        let of = |level: fn(f64) -> f64| boresights.iter().map(|at| level(*at)).collect::<Vec<_>>();
        let pattern = of(|at| 3.0 + 2.0 * at.cos() - (4.0 * at).sin());
        assert!(unexplained_by_harmonics(&pattern, &boresights) < 1e-6);
        let fifth = of(|at| (5.0 * at).cos());
        let left = unexplained_by_harmonics(&fifth, &boresights);
        assert!((left - 20.0).abs() < 0.5, "{left}: half a square dB for each of 40");
    }
}
