use foxhunt_core::{
    EstimatorError, Observation, Role,
    noise::{self, LogProduct},
};
use nalgebra::{SMatrix, SVector};

use crate::{
    Gaussian, Image, Innovation,
    triangle::{self, Conditioned},
};

/// The regression of the state on one observation, in square roots.
///
/// With G Gᵀ = R + W Wᵀ and x = x̂ + L ξ, ξ ~ N(0, I), the observation is G⁻¹ y = B ξ plus white
/// noise, B = G⁻¹ Vᵀ; and the covariance of y is S = R + W Wᵀ + Vᵀ V = G (I + B Bᵀ) Gᵀ. No square
/// is subtracted and S is never formed.
///
/// Missing components are struck out of V, W and y, and stand in R as a unit row.
#[derive(Clone, Copy)]
pub(super) struct Regression<const N: usize, const M: usize> {
    whitened_cross: SMatrix<f64, N, M>,
    /// G, lower triangular: the noise, and what the regression does not explain.
    unexplained: SMatrix<f64, M, M>,
    expected: SVector<f64, M>,
    residual: SVector<f64, M>,
    /// ξ, given y.
    known: Conditioned<N>,
    dof: usize,
}

impl<const N: usize, const M: usize> Regression<N, M> {
    /// `residual` is z ⊖ `image.mean`.
    pub(super) fn new(
        image: &Image<N, M>,
        residual: SVector<f64, M>,
        observation: &Observation<M>,
    ) -> Self {
        let Image { mean: expected, whitened_cross, unexplained: left } = *image;
        let residual = observation.strike(residual);
        let whitened_cross = observation.mask(whitened_cross);
        let left = observation.strike(left);

        // A straight map leaves nothing but the noise.
        let unexplained = match left == SMatrix::<f64, M, M>::zeros() {
            true => *observation.noise_factor(),
            false => triangle::lower_root([*observation.noise_factor(), left]),
        };
        let white = triangle::solve_lower(&unexplained, residual);
        let slope = triangle::solve_lower(&unexplained, whitened_cross.transpose());
        let known = Conditioned::on(slope, white);
        let dof = observation.len();
        Self { whitened_cross, unexplained, expected, residual, known, dof }
    }

    /// Refuses what was made of numbers that are not finite, or without noise.
    pub(super) fn check(&self) -> Result<(), EstimatorError> {
        // Every number goes into this square, and what is not finite makes it so.
        if self.known.square.is_finite() {
            return Ok(());
        }
        let least = (0..M).map(|i| self.unexplained[(i, i)]).fold(f64::INFINITY, f64::min);
        let sum = triangle::nan_unless_finite(&self.residual)
            + triangle::nan_unless_finite(&self.whitened_cross)
            + triangle::nan_unless_finite(&self.unexplained);
        refuse(sum.is_nan(), least)
    }

    pub(super) fn nis(&self) -> f64 {
        self.known.square
    }

    /// ln N(y; 0, S).
    pub(super) fn log_evidence(&self) -> f64 {
        let mut root = LogProduct::default();
        (0..M).for_each(|i| root.multiply(self.unexplained[(i, i)]));
        (0..N).for_each(|i| root.multiply(self.known.roots[i]));
        noise::log_density(self.nis(), root.ln(), self.dof)
    }

    /// Another residual's square in the metric of what is not explained: rᵀ (R + W Wᵀ)⁻¹ r.
    pub(super) fn misfit(&self, residual: &SVector<f64, M>, observation: &Observation<M>) -> f64 {
        let residual = observation.strike(*residual);
        self.unexplained.solve_lower_triangular_unchecked(&residual).norm_squared()
    }

    pub(super) fn innovation(&self) -> Innovation<M> {
        let explained = self.whitened_cross.tr_mul(&self.whitened_cross);
        let mut covariance = triangle::square(&self.unexplained) + explained;
        covariance.fill_upper_triangle_with_lower_triangle();
        let Self { residual, expected, .. } = *self;
        Innovation { residual, expected, covariance, nis: self.nis() }
    }

    /// The posterior's mean x̂ + L E[ξ] and factor L T D^-½, one form for all transforms: with the
    /// covariance T D⁻¹ Tᵀ of ξ it is, by Woodbury's identity,
    ///
    /// P⁺ = P − Pxz S⁻¹ Pxzᵀ = L (I + Bᵀ B)⁻¹ Lᵀ = L T D⁻¹ Tᵀ Lᵀ;
    ///
    /// lower triangular with a positive diagonal whatever was measured.
    pub(super) fn posterior(&self, prior: &Gaussian<N>) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
        let mut factor = triangle::product(prior.factor(), &self.known.factor);
        for (mut column, root) in factor.column_iter_mut().zip(self.known.roots.iter()) {
            column /= *root;
        }
        (prior.mean() + prior.factor() * self.known.mean, factor)
    }
}

/// Returns the reason that there is no innovation, `Ok` if only its square is too large.
#[cold]
#[inline(never)]
fn refuse(not_finite: bool, least_root: f64) -> Result<(), EstimatorError> {
    if not_finite {
        return Err(EstimatorError::NotFinite { role: Role::Expected });
    }
    if least_root <= 0.0 {
        return Err(EstimatorError::NotPositiveDefinite { role: Role::Innovation });
    }
    Ok(())
}
