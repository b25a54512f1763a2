use nalgebra::{SMatrix, SVector};

use super::Pattern;

/// The terms of a harmonic series of order 2: 1, cos, sin, cos 2, sin 2.
const TERMS: usize = 5;

/// How far a turn looks like one smooth lobe rather than scatter: the adjusted coefficient of
/// determination of a harmonic series of order 2, fitted to the per-position means in dB by least
/// squares, R̄² = 1 − (1 − R²)(n − 1)/(n − 5), times the share of the turn that the moving mean covers.
///
/// In [0, 1]; 0 where the turn is flat, or where fewer than six positions were measured.
#[must_use]
pub fn harmonic_confidence(pattern: &Pattern) -> f64 {
    let n = f64::from(pattern.measured());
    let mut normal = SMatrix::<f64, TERMS, TERMS>::zeros();
    let mut moment = SVector::<f64, TERMS>::zeros();
    let mut total = 0.0;
    for (basis, y) in measured(pattern) {
        normal += basis * basis.transpose();
        moment += basis * y;
        total += y * y;
    }
    let freedom = n - 5.0;
    let Some(factor) = normal.cholesky() else { return 0.0 };
    if freedom < 1.0 || total <= 0.0 {
        return 0.0;
    }
    let weights = factor.solve(&moment);
    let residual: f64 = measured(pattern)
        .map(|(basis, y)| {
            let error = y - basis.dot(&weights);
            error * error
        })
        .sum();
    let adjusted = 1.0 - residual / total * (n - 1.0) / freedom;
    (adjusted * coverage(pattern)).clamp(0.0, 1.0)
}

/// The harmonics at each measured position, and its power above the turn's mean in dB.
fn measured(pattern: &Pattern) -> impl Iterator<Item = (SVector<f64, TERMS>, f64)> {
    pattern.cells().iter().filter_map(|cell| {
        let (sin, cos) = libm::sincos(cell.angle());
        let basis = [1.0, cos, sin, cos * cos - sin * sin, 2.0 * sin * cos];
        Some((SVector::from(basis), cell.mean_dbm()? - pattern.rss_dbm()))
    })
}

/// The share of positions that have a moving mean.
fn coverage(pattern: &Pattern) -> f64 {
    let (covered, all) = pattern.cells().iter().fold((0.0, 0.0), |(covered, all), cell| {
        (covered + f64::from(u8::from(cell.smoothed_dbm().is_some())), all + 1.0)
    });
    covered / all
}
