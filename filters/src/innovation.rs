use foxhunt_core::{
    Covariance, Estimator, MeasurementModel, Observation, State, absorb_receiver_noise,
};
use nalgebra::SVector;

/// Difference between an observation and its expectation: the raw material of consistency checks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation<const M: usize> {
    /// y = z ⊖ ẑ; 0 for a missing component.
    pub residual: SVector<f64, M>,
    /// ẑ, in the measurement's units; its angles are not wrapped.
    pub expected: SVector<f64, M>,
    /// S = Pzz + R; a missing component is decoupled and of unit variance.
    pub covariance: Covariance<M>,
    /// yᵀ S⁻¹ y; χ² with as many degrees of freedom as components are present, if the filter is
    /// consistent (Bar-Shalom, Li & Kirubarajan 2001, §5.4.2; "NEES" in Pritzl 2018, eq. 4.17).
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
        let expected = |x: &State<N>| model.expected(x, observation.receiver());
        let centre = expected(mean);
        let mut shift = SVector::<f64, M>::zeros();
        let mut square = Covariance::<M>::zeros();
        visit_samples(&mut |state, weight| {
            let deviation = model.residual(&expected(state), &centre);
            shift += deviation * weight;
            square += deviation * (deviation * weight).transpose();
        });
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

    /// H⁻¹ y with H Hᵀ = S: independent standard normal numbers if the filter is consistent, 0 for
    /// a missing component. `None` where S is not positive definite.
    #[must_use]
    pub fn normalised(&self) -> Option<SVector<f64, M>> {
        self.covariance.cholesky()?.unpack().solve_lower_triangular(&self.residual)
    }
}
