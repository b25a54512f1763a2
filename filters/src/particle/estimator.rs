use core::mem;

use foxhunt_core::{
    Correction, Covariance, Estimate, Estimator, EstimatorError, MeasurementModel, MotionModel,
    Observation, Role, State,
};
use nalgebra::SVector;
use rand::Rng;

use super::{cloud::moments, filter::ParticleFilter};
use crate::Gaussian;

impl<F, H, R, const N: usize, const M: usize> Estimator<N, M> for ParticleFilter<F, H, R, N, M>
where
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
    R: Rng + Clone,
{
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        if !(dt >= 0.0 && dt.is_finite()) {
            return Err(EstimatorError::TimeStep { dt });
        }
        if dt <= 0.0 {
            return Ok(());
        }
        let mut rng = self.rng.clone();
        self.prepare_moved(dt, &mut rng);
        let belief = moments(&self.spare.columns, &self.spare.weights.linear, &self.motion.axes());
        self.belief = Gaussian::new(belief, Role::Posterior)?;
        self.rng = rng;
        mem::swap(&mut self.cloud, &mut self.spare);
        Ok(())
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        if observation.is_empty() {
            return Ok(Correction::Empty);
        }
        let columns: [&[f64]; N] = core::array::from_fn(|row| &self.cloud.columns[row][..]);
        self.measurement.log_likelihoods(columns, observation, &mut self.spare.weights.log);
        let log_evidence = self.spare.weights.condition(&self.cloud.weights)?;
        let belief = moments(&self.cloud.columns, &self.spare.weights.linear, &self.motion.axes());
        let belief = Gaussian::new(belief, Role::Posterior)?;
        let nis = self.nis(observation);
        self.belief = belief;
        mem::swap(&mut self.cloud.weights, &mut self.spare.weights);
        let effective_sample_size = Some(self.cloud.weights.effective_sample_size());
        Ok(Correction::Fused { nis, log_evidence, effective_sample_size })
    }

    fn estimate(&self) -> Estimate<N> {
        *self.belief.estimate()
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        for (i, weight) in self.cloud.weights.linear.iter().enumerate() {
            visit(&State::from_fn(|row, _| self.cloud.columns[row][i]), *weight);
        }
    }
}

impl<F, H, R, const N: usize, const M: usize> ParticleFilter<F, H, R, N, M>
where
    H: MeasurementModel<N, M>,
{
    /// yᵀ S⁻¹ y with the moments of what the cloud expects: deviations are taken about what is
    /// expected at its mean, as a Kalman filter's are about its centre. `None` where the model
    /// expects nothing finite.
    fn nis(&self, observation: &Observation<M>) -> Option<f64> {
        let expected = |x: &State<N>| self.measurement.expected(x, observation.receiver());
        let centre = expected(self.belief.mean());
        let (mut shift, mut square) = (SVector::<f64, M>::zeros(), Covariance::<M>::zeros());
        for (i, weight) in self.cloud.weights.linear.iter().enumerate() {
            let state = State::from_fn(|row, _| self.cloud.columns[row][i]);
            let deviation = self.measurement.residual(&expected(&state), &centre);
            shift += deviation * *weight;
            square += deviation * (deviation * *weight).transpose();
        }
        let spread = square - shift * shift.transpose();
        let residual = self.measurement.residual(observation.value(), &(centre + shift));
        let residual = observation.mask(residual.transpose()).transpose();
        let spread = observation.mask(observation.mask(spread).transpose());
        let factor = (spread + observation.noise()).cholesky()?;
        Some(residual.dot(&factor.solve(&residual))).filter(|nis| nis.is_finite())
    }
}
