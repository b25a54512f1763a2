use foxhunt_core::{Estimate, EstimatorError, MeasurementModel, MotionModel, Role};
use rand::Rng;

use super::{filter::ParticleFilter, white::white};
use crate::{Gaussian, Reinitialise};

/// Draws the cloud again: what was not Gaussian in it is lost.
impl<F, H, R, const N: usize, const M: usize> Reinitialise<N> for ParticleFilter<F, H, R, N, M>
where
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
    R: Rng + Clone,
{
    fn reinitialise(&mut self, estimate: &Estimate<N>) -> Result<(), EstimatorError> {
        let belief = Gaussian::new(*estimate, Role::Prior)?;
        for particle in 0..self.cloud.len() {
            let state = belief.mean() + belief.factor() * white(&mut self.rng);
            self.cloud.set(particle, &state);
        }
        self.cloud.weights.fill_even(self.workers.threads);
        self.belief = belief;
        Ok(())
    }
}
