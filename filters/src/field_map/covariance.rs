use alloc::vec::Vec;

use faer::{Mat, Side, linalg::solvers::Llt};
use nalgebra::Vector2;

/// Matérn's correlation of smoothness 3/2, (1 + √3 d/ℓ) exp(−√3 d/ℓ) (Rasmussen & Williams 2006,
/// eq. 4.17): a field that has slopes and no more, as a level near its transmitter.
pub(super) fn matern(a: &Vector2<f64>, b: &Vector2<f64>, length_m: f64) -> f64 {
    let scaled = libm::sqrt(3.0) * (a - b).norm() / length_m;
    (1.0 + scaled) * libm::exp(-scaled)
}

/// The readings' correlation, factored: C = L Lᵀ.
#[derive(Clone, Debug)]
pub(super) struct Correlation {
    factor: Llt<f64>,
    /// u = L⁻¹ 1.
    pub(super) ones: Vec<f64>,
}

impl Correlation {
    /// `C_ij = (1 − ν) k(|pᵢ − pⱼ|/ℓ) + ν δ_ij`; `None` where it has no factor.
    pub(super) fn new(places: &[Vector2<f64>], length_m: f64, noise_share: f64) -> Option<Self> {
        let n = places.len();
        let matrix = Mat::<f64>::from_fn(n, n, |i, j| match i == j {
            true => 1.0,
            false => (1.0 - noise_share) * matern(&places[i], &places[j], length_m),
        });
        let factor = Llt::new(matrix.as_ref(), Side::Lower).ok()?;
        let mut correlation = Self { factor, ones: Vec::new() };
        let mut ones = Mat::<f64>::from_fn(n, 1, |_, _| 1.0);
        correlation.whiten(&mut ones);
        correlation.ones = column(&ones, 0);
        Some(correlation)
    }

    /// Replaces X by L⁻¹ X.
    pub(super) fn whiten(&self, x: &mut Mat<f64>) {
        self.factor.L().solve_lower_triangular_in_place(x.as_mut());
    }

    /// ½ ln |C|.
    pub(super) fn half_log_determinant(&self) -> f64 {
        let factor = self.factor.L();
        (0..factor.nrows()).map(|i| libm::log(factor[(i, i)])).sum()
    }
}

/// A column's numbers.
pub(super) fn column(matrix: &Mat<f64>, j: usize) -> Vec<f64> {
    (0..matrix.nrows()).map(|i| matrix[(i, j)]).collect()
}

/// Σ aᵢ bᵢ.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
