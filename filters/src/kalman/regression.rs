use foxhunt_core::{EstimatorError, Observation, Role, noise};
use nalgebra::{SMatrix, SVector};

use crate::{Gaussian, Image, Innovation, triangle};

/// The regression of the state on one observation, with every covariance in factored form.
///
/// S = R + W Wᵀ + Vᵀ V. Missing components are struck out of V, W and y, and stand in R as a
/// unit row.
#[derive(Clone, Copy)]
pub(super) struct Regression<const N: usize, const M: usize> {
    whitened_cross: SMatrix<f64, N, M>,
    /// G Gᵀ = R + W Wᵀ: the noise, and what the regression does not explain.
    unexplained: SMatrix<f64, M, M>,
    /// H Hᵀ = S.
    innovation: SMatrix<f64, M, M>,
    expected: SVector<f64, M>,
    residual: SVector<f64, M>,
    /// H⁻¹ y.
    white: SVector<f64, M>,
    dof: usize,
}

impl<const N: usize, const M: usize> Regression<N, M> {
    /// `residual` is z ⊖ `image.mean`.
    pub(super) fn new(
        image: &Image<N, M>,
        residual: SVector<f64, M>,
        observation: &Observation<M>,
    ) -> Result<Self, EstimatorError> {
        let finite = |mut values: core::slice::Iter<'_, f64>| values.all(|v| v.is_finite());
        if ![image.mean.as_slice(), residual.as_slice()].iter().all(|v| finite(v.iter()))
            || ![image.whitened_cross.as_slice(), image.unexplained.as_slice()]
                .iter()
                .all(|v| finite(v.iter()))
        {
            return Err(EstimatorError::NotFinite { role: Role::Expected });
        }
        let residual = observation.strike(residual);
        let whitened_cross = observation.mask(image.whitened_cross);
        let left = observation.strike(image.unexplained);

        let mut unexplained = *observation.noise_factor();
        for column in left.column_iter() {
            triangle::add_to_lower(&mut unexplained, column.into_owned());
        }
        let mut innovation = unexplained;
        for row in whitened_cross.row_iter() {
            triangle::add_to_lower(&mut innovation, row.transpose());
        }
        let white = innovation
            .solve_lower_triangular(&residual)
            .ok_or(EstimatorError::NotPositiveDefinite { role: Role::Innovation })?;
        let (expected, dof) = (image.mean, observation.len());
        Ok(Self { whitened_cross, unexplained, innovation, expected, residual, white, dof })
    }

    pub(super) fn nis(&self) -> f64 {
        self.white.norm_squared()
    }

    /// ln N(y; 0, S).
    pub(super) fn log_evidence(&self) -> f64 {
        noise::gaussian(&self.residual, &self.innovation, self.dof)
    }

    /// Another residual's square in the metric of what is not explained: rᵀ (R + W Wᵀ)⁻¹ r.
    pub(super) fn misfit(&self, residual: &SVector<f64, M>, observation: &Observation<M>) -> f64 {
        let residual = observation.strike(*residual);
        self.unexplained.solve_lower_triangular_unchecked(&residual).norm_squared()
    }

    pub(super) fn innovation(&self) -> Innovation<M> {
        Innovation {
            residual: self.residual,
            expected: self.expected,
            covariance: triangle::square(&self.innovation),
            nis: self.nis(),
        }
    }

    /// The posterior's mean and factor, one form for all transforms:
    ///
    /// x̂⁺ = x̂ + L V S⁻¹ y, and by Woodbury's identity
    /// P⁺ = P − Pxz S⁻¹ Pxzᵀ = L (I + V (G Gᵀ)⁻¹ Vᵀ)⁻¹ Lᵀ = (L U⁻ᵀ)(L U⁻ᵀ)ᵀ
    ///
    /// with U upper triangular and U Uᵀ = I + V (G Gᵀ)⁻¹ Vᵀ, a sum of squares; so that the new
    /// factor L U⁻ᵀ is lower triangular with a positive diagonal whatever was measured.
    pub(super) fn posterior(
        &self,
        prior: &Gaussian<N>,
    ) -> Option<(SVector<f64, N>, SMatrix<f64, N, N>)> {
        let step = self.innovation.tr_solve_lower_triangular(&self.white)?;
        let mean = prior.mean() + prior.factor() * (self.whitened_cross * step);

        let information =
            self.unexplained.solve_lower_triangular(&self.whitened_cross.transpose())?;
        let mut upper = SMatrix::identity();
        for row in information.row_iter() {
            triangle::add_to_upper(&mut upper, row.transpose());
        }
        let factor = upper.solve_upper_triangular(&prior.factor().transpose())?.transpose();
        Some((mean, factor.lower_triangle()))
    }
}
