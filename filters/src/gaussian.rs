//! Gaussian beliefs, and the innovations of observations under a belief.

use foxhunt_core::{
    Axis, Covariance, Estimate, Estimator, EstimatorError, MeasurementModel, Observation, Role,
    State, absorb_receiver_noise,
};
use nalgebra::{SMatrix, SVector};

use crate::{count::number, triangle};

/// Number of samples whose expectations are taken at once.
const BLOCK: usize = 64;

/// A Gaussian belief, its covariance factored: P = L Lᵀ.
///
/// Invariant: mean and covariance are finite, and the covariance is positive definite.
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

    /// The Gaussian with these moments; `None` where the covariance, of which the lower triangle is
    /// read, has no factor.
    #[inline(always)]
    pub(crate) fn factored(estimate: Estimate<N>) -> Option<Self> {
        triangle::cholesky(estimate.covariance).map(|factor| Self { estimate, factor })
    }

    /// The Gaussian with these moments and this factor of the covariance.
    pub(crate) fn with_factor(estimate: Estimate<N>, factor: SMatrix<f64, N, N>) -> Self {
        Self { estimate, factor }
    }

    /// The Gaussian with the covariance L Lᵀ, after a step; L has no negative diagonal.
    pub(crate) fn from_factor(
        mean: State<N>,
        factor: SMatrix<f64, N, N>,
        axes: &[Axis; N],
    ) -> Result<Self, EstimatorError> {
        let role = Role::Posterior;
        let mean = Axis::difference(axes, &mean, &State::zeros());
        let mut covariance = triangle::square(&factor);
        if !mean.iter().chain(covariance.iter()).all(|c| c.is_finite()) {
            return Err(EstimatorError::NotFinite { role });
        }
        if factor.diagonal().iter().any(|d| *d <= 0.0) {
            return Err(EstimatorError::NotPositiveDefinite { role });
        }
        // Squaring doubles the digits that a thin belief needs. Where they are not there, the
        // returned covariance has a few units in the last place added to its variances, which
        // makes a rounded square definite again (Higham 2002, §10.1); the factor itself stays.
        if covariance.cholesky().is_none() {
            let last_places = 1.0 + 8.0 * number(N) * f64::EPSILON;
            (0..N).for_each(|i| covariance[(i, i)] *= last_places);
        }
        Ok(Self { estimate: Estimate { mean, covariance }, factor })
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

/// Difference between an observation and its expectation: the raw material of consistency checks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation<const M: usize> {
    /// y = z ⊖ ẑ; 0 for a missing component.
    pub residual: SVector<f64, M>,
    /// ẑ, in the measurement's units; its angles are not wrapped.
    pub expected: SVector<f64, M>,
    /// S = Pzz + R; a missing component is decoupled and of unit variance.
    pub covariance: Covariance<M>,
    /// yᵀ S⁻¹ y; χ² with as many degrees of freedom as components are present, if the filter
    /// is consistent (Bar-Shalom, Li & Kirubarajan 2001, §5.4.2; "NEES" in Pritzl 2018, eq. 4.17).
    pub nis: f64,
}

impl<const M: usize> Innovation<M> {
    /// The innovation of an observation that `estimator` has not fused yet, from the moments
    /// of what its samples expect: for any family, whatever it is made of.
    ///
    /// Deviations are taken about what is expected at the belief's mean, as a Kalman filter's are
    /// about its centre. `None` for an observation without components, censored or not, or
    /// the model expects nothing finite.
    #[must_use]
    pub fn of_belief<const N: usize>(
        estimator: &(impl Estimator<N, M> + ?Sized),
        model: &(impl MeasurementModel<N, M> + ?Sized),
        observation: &Observation<M>,
    ) -> Option<Self> {
        let mean = estimator.estimate().mean;
        Self::of_samples(&mean, |visit| estimator.visit_samples(visit), model, observation)
    }

    /// Returns the innovation from samples of a belief with this mean; their weights sum to 1.
    pub(crate) fn of_samples<const N: usize>(
        mean: &State<N>,
        visit_samples: impl FnOnce(&mut dyn FnMut(&State<N>, f64)),
        model: &(impl MeasurementModel<N, M> + ?Sized),
        observation: &Observation<M>,
    ) -> Option<Self> {
        if observation.is_empty() {
            return None;
        }
        let observation = &absorb_receiver_noise(model, mean, observation);
        let receiver = observation.receiver();
        let centre = model.expected(mean, receiver);
        let mut shift = SVector::<f64, M>::zeros();
        let mut square = Covariance::<M>::zeros();
        // In blocks, for models that are called once for many states.
        let mut states = [State::<N>::zeros(); BLOCK];
        let mut weights = [0.0; BLOCK];
        let mut expected = [SVector::<f64, M>::zeros(); BLOCK];
        let mut add = |states: &[State<N>], weights: &[f64]| {
            let expected = &mut expected[..states.len()];
            model.expected_many(states, receiver, expected);
            for (expected, weight) in expected.iter().zip(weights) {
                let deviation = model.residual(expected, &centre);
                shift += deviation * *weight;
                square += deviation * (deviation * *weight).transpose();
            }
        };
        let mut count = 0;
        visit_samples(&mut |state, weight| {
            states[count] = *state;
            weights[count] = weight;
            count += 1;
            if count == BLOCK {
                add(&states, &weights);
                count = 0;
            }
        });
        if count > 0 {
            add(&states[..count], &weights[..count]);
        }
        Self::of_deviations(&centre, &shift, &square, model, observation)
    }

    /// Returns the innovation from Σ w d and Σ w d dᵀ of the deviations d from `centre`; the
    /// receiver's uncertain place is in the observation's noise.
    pub(crate) fn of_deviations<const N: usize>(
        centre: &SVector<f64, M>,
        shift: &SVector<f64, M>,
        square: &Covariance<M>,
        model: &(impl MeasurementModel<N, M> + ?Sized),
        observation: &Observation<M>,
    ) -> Option<Self> {
        let spread = square - shift * shift.transpose();
        let expected = centre + shift;
        let residual = model.residual(observation.value(), &expected);
        let residual = observation.strike(residual);
        let spread = observation.mask(observation.mask(spread).transpose());
        let covariance = spread + observation.noise();
        let nis = residual.dot(&covariance.cholesky()?.solve(&residual));
        nis.is_finite().then_some(Self { residual, expected, covariance, nis })
    }

    /// H⁻¹ y with H Hᵀ = S: independent standard normal numbers if the filter is consistent, 0
    /// for a missing component. `None` where S is not positive definite.
    #[must_use]
    pub fn normalised(&self) -> Option<SVector<f64, M>> {
        self.covariance.cholesky()?.unpack().solve_lower_triangular(&self.residual)
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

    #[test]
    fn a_belief_too_thin_for_its_square_is_reported_a_little_wider() {
        // 45° aslant, 1 km long and 1 nm wide: the square would need 24 digits.
        let thin = Matrix2::new(1e3, 0.0, 1e3, 1e-9);
        let axes = [Axis::Linear; 2];
        let belief = Gaussian::from_factor(Vector2::zeros(), thin, &axes).expect("definite");
        assert!((thin * thin.transpose()).cholesky().is_none());
        let covariance = belief.estimate().covariance;
        assert!(covariance.cholesky().is_some());
        assert!((covariance - thin * thin.transpose()).norm() < 1e-14 * covariance.norm());
        assert_eq!(belief.factor(), &thin);
        let flat = Matrix2::new(1.0, 0.0, 1.0, 0.0);
        let refused = Gaussian::from_factor(Vector2::zeros(), flat, &axes);
        assert_eq!(refused, Err(EstimatorError::NotPositiveDefinite { role: Role::Posterior }));
    }
}
