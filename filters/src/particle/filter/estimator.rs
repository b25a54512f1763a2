//! Prediction and update of the particle filter, at once or in stages.

use core::mem;

use foxhunt_core::{
    Correction, Estimate, Estimator, EstimatorError, MeasurementModel, MotionModel, Observation,
    Quantity, Role, State, columns,
};
use rand::Rng;

use super::ParticleFilter;
use crate::{
    Gaussian, Innovation,
    count::number,
    particle::{
        Cloud, KEPT, MOST_STAGES, Modelled, Weights, largest_exponent,
        step::{Step, Workers, moments},
        white::Kernel,
    },
};

impl<F, H, R, const N: usize, const M: usize> Estimator<N, M> for ParticleFilter<F, H, R, N, M>
where
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
    R: Rng,
{
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)?;
        if dt <= 0.0 {
            return Ok(());
        }
        let (anew, moments) = self.prepare_moved(dt);
        let weights = if anew { &self.spare.weights } else { &self.cloud.weights };
        let moments = moments.unwrap_or_else(|| self.moments(&self.spare.columns, weights));
        self.belief = self.belief_of(moments, weights)?;
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

impl<F, H, R, const N: usize, const M: usize> ParticleFilter<F, H, R, N, M>
where
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
    R: Rng,
{
    /// Applies the likelihood in factors p(z | x)^φ, Σ φ = 1, resampling with the kernel in
    /// between (Musso, Oudjane & Le Gland 2001), each φ so that the cloud keeps half of
    /// its effective sample size. The log-evidence is the sum of the stages'.
    fn correct_in_stages(&mut self, observation: &Observation<M>) -> Result<f64, EstimatorError> {
        let mut corrected = self.cloud.clone();
        // Out of the filter for a while; an empty cloud takes no memory.
        let mut next = mem::replace(&mut self.spare, Cloud::empty());
        let mut ancestors = mem::take(&mut self.ancestors);
        next.resize(corrected.len());
        ancestors.resize(corrected.len(), 0);
        let outcome = self.apply_in_stages(observation, &mut corrected, &mut next, &mut ancestors);
        if let Ok((belief, _)) = outcome {
            self.cloud = corrected;
            self.belief = belief;
        }
        (self.spare, self.ancestors) = (next, ancestors);
        outcome.map(|(_, log_evidence)| log_evidence)
    }

    /// Conditions `cloud`, which holds this filter's.
    fn apply_in_stages(
        &mut self,
        observation: &Observation<M>,
        cloud: &mut Cloud<N>,
        next: &mut Cloud<N>,
        ancestors: &mut [u32],
    ) -> Result<(Gaussian<N>, f64), EstimatorError> {
        let mut belief = self.belief;
        let mut left = 1.0;
        let mut log_evidence = 0.0;
        for stage in 1..=MOST_STAGES {
            // At the first stage alone the cloud may be uneven.
            if cloud.weights.effective_sample_size() < KEPT * number(cloud.len()) {
                self.regularise(&belief, cloud, next, ancestors);
                mem::swap(cloud, next);
            }
            let columns = core::array::from_fn(|row| &cloud.columns[row][..]);
            self.measurement.log_likelihoods(columns, observation, &mut next.weights.log);
            let exponent = match stage {
                MOST_STAGES => left,
                _ => exponent(&cloud.weights, &next.weights.log, left),
            };
            next.weights.log.iter_mut().for_each(|log| *log *= exponent);
            log_evidence += next.weights.condition(&cloud.weights, self.workers.threads)?;
            mem::swap(&mut cloud.weights, &mut next.weights);
            left -= exponent;
            belief =
                self.belief_of(self.moments(&cloud.columns, &cloud.weights), &cloud.weights)?;
            if left <= 0.0 {
                break;
            }
            self.regularise(&belief, cloud, next, ancestors);
            mem::swap(cloud, next);
        }
        Ok((belief, log_evidence))
    }

    /// Resamples `from` into `next` with the kernel about its own moments.
    fn regularise(
        &mut self,
        belief: &Gaussian<N>,
        from: &Cloud<N>,
        next: &mut Cloud<N>,
        ancestors: &mut [u32],
    ) {
        let axes = self.motion.axes();
        let threads = self.workers.threads;
        let own = moments(&from.columns, &from.weights.linear, &axes, threads);
        // A cloud that has collapsed has no moments of its own.
        let belief = Gaussian::new(own, Role::Posterior).unwrap_or(*belief);
        let bandwidth = self.bandwidth_of(from.len());
        let kernel = Kernel::new(belief.mean(), belief.factor(), bandwidth, axes);
        let scratch = next.weights.scratch();
        self.resampling.draw(&from.weights.linear, &mut self.rng, scratch, ancestors, threads);
        let _ = (self.workers.step)(Step {
            key: self.rng.next_u64(),
            from: &from.columns,
            to: columns::slices_mut(&mut next.columns),
            first: 0,
            ancestors: Some(ancestors),
            kernel: kernel.as_ref(),
            motion: None,
            axes,
            weights: None,
        });
        next.weights.fill_even(threads);
    }
}

/// The largest exponent, up to `left`, after which the cloud has [`KEPT`] of the effective sample
/// size that particles which are possible at all have.
fn exponent(prior: &Weights, logs: &[f64], left: f64) -> f64 {
    let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let size = |exponent: f64| {
        let mut sum = 0.0;
        let mut squares = 0.0;
        for (weight, log) in prior.linear.iter().zip(logs) {
            if *log > f64::NEG_INFINITY {
                let weight = weight * libm::exp(exponent * (log - best));
                sum += weight;
                squares += weight * weight;
            }
        }
        sum * sum / squares
    };
    largest_exponent(left, KEPT * size(0.0), size)
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
