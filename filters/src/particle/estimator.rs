use core::mem;

use foxhunt_core::{
    Correction, Estimate, Estimator, EstimatorError, MeasurementModel, MotionModel, Observation,
    Quantity, State,
};
use rand::Rng;

use super::{cloud::Modelled, filter::ParticleFilter, workers::Workers};
use crate::{Innovation, count::number};

impl<F, H, R, const N: usize, const M: usize> Estimator<N, M> for ParticleFilter<F, H, R, N, M>
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
        let (anew, moments) = self.prepare_moved(dt, &mut rng);
        let weights = if anew { &self.spare.weights } else { &self.cloud.weights };
        let moments = moments.unwrap_or_else(|| self.moments(&self.spare.columns, weights));
        self.belief = self.belief_of(moments, weights)?;
        self.rng = rng;
        mem::swap(&mut self.cloud.columns, &mut self.spare.columns);
        if anew {
            mem::swap(&mut self.cloud.weights, &mut self.spare.weights);
        }
        Ok(())
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        // An observation below a limit counts where the model has a likelihood for it.
        if observation.is_empty() && !observation.is_censored() {
            return Ok(Correction::Empty);
        }
        let visit_some = |visit: &mut dyn FnMut(&State<N>, f64)| self.visit_some(visit);
        let mean = self.belief.mean();
        let nis = Innovation::of_samples(mean, visit_some, &self.measurement, observation)
            .map(|innovation| innovation.nis);
        let count = self.cloud.len();
        self.spare.resize(count);
        let model = &self.measurement;
        let columns = &self.cloud.columns;
        let likelihoods = Modelled { model, columns, observation };
        let Workers { multiply, threads, .. } = self.workers;
        let prior = &self.cloud.weights;
        let weights = &mut self.spare.weights;
        let log_evidence = weights.condition_on(prior, &likelihoods, multiply, threads)?;
        let size = self.spare.weights.effective_sample_size();
        let log_evidence = if size < self.progressive * number(count) {
            self.correct_in_stages(observation)?
        } else {
            let weights = &self.spare.weights;
            self.belief = self.belief_of(self.moments(&self.cloud.columns, weights), weights)?;
            mem::swap(&mut self.cloud.weights, &mut self.spare.weights);
            log_evidence
        };
        let effective_sample_size = Some(self.cloud.weights.effective_sample_size());
        Ok(Correction::Fused { nis, log_evidence, effective_sample_size })
    }

    fn estimate(&self) -> Estimate<N> {
        *self.belief.estimate()
    }

    fn quantities(&self) -> [Quantity; M] {
        self.measurement.quantities()
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        for (i, weight) in self.cloud.weights.linear.iter().enumerate() {
            visit(&self.cloud.state(i), *weight);
        }
    }
}

#[cfg(test)]
mod tests {
    use foxhunt_core::{Pose, Quantity, RandomWalk};
    use nalgebra::{Matrix1, Vector1};
    use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

    use super::*;

    /// z = x.
    struct Itself;

    impl MeasurementModel<1, 1> for Itself {
        fn quantities(&self) -> [Quantity; 1] {
            [Quantity::linear("x_m")]
        }
        fn expected(&self, state: &State<1>, _receiver: &Pose) -> Vector1<f64> {
            *state
        }
    }

    #[test]
    fn a_run_keeps_to_the_memory_it_began_with() {
        let prior = Estimate::isotropic(Vector1::zeros(), 1.0);
        let rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let mut filter = ParticleFilter::new(RandomWalk::uniform(0.1), Itself, prior, 64, rng)
            .and_then(|filter| filter.with_progressive_correction(0.0))
            .expect("a proper prior");
        let places = |filter: &ParticleFilter<_, _, _, 1, 1>| {
            let mut places = [&filter.cloud, &filter.spare].map(|cloud| {
                let weights = &cloud.weights;
                [cloud.columns[0].as_ptr(), weights.linear.as_ptr(), weights.log.as_ptr()]
            });
            // Prepared and taken steps change places.
            places.iter_mut().for_each(|cloud| cloud.sort_unstable());
            let mut places = places.concat();
            places.sort_unstable();
            (places, filter.ancestors.as_ptr())
        };
        let before = places(&filter);
        let z = Vector1::new(1.5);
        let noise = Matrix1::new(0.05);
        let observation = Observation::new(0.0, Pose::default(), z, noise).expect("proper");
        let mut resampled = false;
        for _ in 0..10 {
            filter.predict(1.0).expect("a proper step");
            let _ = filter.update(&observation).expect("possible");
            resampled |= filter.effective_sample_size() < 32.0;
        }
        assert!(resampled, "half of it was not tested");
        assert_eq!(places(&filter), before);
    }
}
