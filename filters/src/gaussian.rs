use foxhunt_core::{Axis, Covariance, Estimate, EstimatorError, Role, State};
use nalgebra::SMatrix;

use crate::triangle;

/// A Gaussian belief, its covariance factored: P = L Lᵀ.
///
/// There is none that is not finite and positive definite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian<const N: usize> {
    estimate: Estimate<N>,
    factor: SMatrix<f64, N, N>,
}

impl<const N: usize> Gaussian<N> {
    /// The Gaussian with these moments, which play `role` in the step that is under way.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::NotFinite`], or [`EstimatorError::NotPositiveDefinite`] when the
    /// covariance is not symmetric (to 1e-9 of its norm) or has no Cholesky factor.
    pub fn new(estimate: Estimate<N>, role: Role) -> Result<Self, EstimatorError> {
        let Estimate { mean, covariance } = estimate;
        if !mean.iter().chain(covariance.iter()).all(|c| c.is_finite()) {
            return Err(EstimatorError::NotFinite { role });
        }
        let skew: Covariance<N> = covariance - covariance.transpose();
        let factor = covariance.cholesky().filter(|_| skew.norm() <= 1e-9 * covariance.norm());
        let factor = factor.ok_or(EstimatorError::NotPositiveDefinite { role })?.unpack();
        Ok(Self { estimate, factor })
    }

    /// The Gaussian with the covariance L Lᵀ.
    pub(crate) fn from_factor(
        mean: State<N>,
        factor: SMatrix<f64, N, N>,
        axes: &[Axis; N],
        role: Role,
    ) -> Result<Self, EstimatorError> {
        // An angle of the state is told on [−π, π).
        let mean = Axis::difference(axes, &mean, &State::zeros());
        let covariance = triangle::square(&factor);
        // The factor is kept as it came, it is better than that of the squared numbers; but what
        // is told must have one too.
        let checked = Self::new(Estimate { mean, covariance }, role)?;
        Ok(Self { factor, ..checked })
    }

    /// The mean.
    #[must_use]
    pub fn mean(&self) -> &State<N> {
        &self.estimate.mean
    }

    /// L, lower triangular, with L Lᵀ = P.
    #[must_use]
    pub fn factor(&self) -> &SMatrix<f64, N, N> {
        &self.factor
    }

    /// The two moments.
    #[must_use]
    pub fn estimate(&self) -> &Estimate<N> {
        &self.estimate
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::*;

    #[test]
    fn improper_moments_are_refused() {
        let make = |x: f64, covariance| {
            Gaussian::new(Estimate { mean: Vector2::new(x, 0.0), covariance }, Role::Prior)
        };
        assert!(make(1.0, Matrix2::new(4.0, 1.0, 1.0, 2.0)).is_ok());
        let not_finite = Err(EstimatorError::NotFinite { role: Role::Prior });
        assert_eq!(make(f64::NAN, Matrix2::identity()), not_finite);
        assert_eq!(make(0.0, Matrix2::new(1.0, 0.0, f64::INFINITY, 1.0)), not_finite);
        let indefinite = Err(EstimatorError::NotPositiveDefinite { role: Role::Prior });
        assert_eq!(make(0.0, Matrix2::new(1.0, 2.0, 2.0, 1.0)), indefinite);
        assert_eq!(make(0.0, Matrix2::zeros()), indefinite);
        assert_eq!(make(0.0, Matrix2::new(4.0, 0.0, 1.0, 2.0)), indefinite, "skew");
    }
}
