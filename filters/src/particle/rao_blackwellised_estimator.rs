use foxhunt_core::{
    Correction, Estimate, Estimator, EstimatorError, MeasurementModel, MotionModel, Observation,
    Quantity, State,
};
use rand::Rng;

use super::rao_blackwellised::RaoBlackwellised;
use crate::{Innovation, count::number};

impl<F, H, R, const N: usize, const M: usize, const K: usize> Estimator<N, M>
    for RaoBlackwellised<F, H, R, N, M, K>
where
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
    R: Rng + Clone,
{
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)?;
        if dt <= 0.0 {
            return Ok(());
        }
        let mut rng = self.rng.clone();
        let cloud = self.moved(dt, &mut rng)?;
        self.belief = self.belief_of(&cloud)?;
        (self.cloud, self.rng) = (cloud, rng);
        Ok(())
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        if observation.is_empty() {
            return Ok(Correction::Empty);
        }
        let nis = Innovation::of_belief(&*self, &self.measurement, observation);
        let mut rng = self.rng.clone();
        let (cloud, log_evidence) = self.corrected(observation, &mut rng)?;
        self.belief = self.belief_of(&cloud)?;
        (self.cloud, self.rng) = (cloud, rng);
        Ok(Correction::Fused {
            nis: nis.map(|innovation| innovation.nis),
            log_evidence,
            effective_sample_size: Some(self.effective_sample_size()),
        })
    }

    fn estimate(&self) -> Estimate<N> {
        self.belief
    }

    fn quantities(&self) -> [Quantity; M] {
        self.measurement.quantities()
    }

    /// Each particle with the 2 K cubature points of what is not sampled.
    fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        for (i, weight) in self.cloud.means.weights.linear.iter().enumerate() {
            let particle = self.cloud.particle(i);
            let Some(factor) = particle.spread.cholesky() else {
                visit(&particle.state, *weight);
                continue;
            };
            let spread = factor.unpack() * libm::sqrt(number(K));
            for column in spread.column_iter() {
                for sign in [1.0, -1.0] {
                    let mut state = particle.state;
                    (0..K).for_each(|row| state[N - K + row] += sign * column[row]);
                    visit(&state, 0.5 * weight / number(K));
                }
            }
        }
    }
}
