use core::mem;

use foxhunt_core::{EstimatorError, MeasurementModel, MotionModel, Observation, Role};
use rand::Rng;

use super::{
    cloud::{Cloud, Weights},
    filter::ParticleFilter,
    kernel::Kernel,
    moments::moments,
    step::Step,
};
use crate::{Gaussian, count::number};

/// The share of its effective sample size that a cloud keeps in each stage.
pub(super) const KEPT: f64 = 0.5;

/// Bisections of an exponent's logarithm: to a thousandth of it.
const HALVINGS: u32 = 14;

/// Least share of the remaining likelihood that a stage applies.
const LEAST_EXPONENT: f64 = 1e-9;

/// Number of stages after which the remaining likelihood is applied at once. Each narrows a cloud
/// to about half its width: an observation that needs more is one that nothing led to.
pub(super) const MOST_STAGES: u32 = 40;

impl<F, H, R, const N: usize, const M: usize> ParticleFilter<F, H, R, N, M>
where
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
    R: Rng + Clone,
{
    /// Applies the likelihood in factors p(z | x)^φ, Σ φ = 1, resampling with the kernel in
    /// between (Musso, Oudjane & Le Gland 2001), each φ so that the cloud keeps half of
    /// its effective sample size. The log-evidence is the sum of the stages'.
    pub(super) fn correct_in_stages(
        &mut self,
        observation: &Observation<M>,
    ) -> Result<f64, EstimatorError> {
        let mut rng = self.rng.clone();
        let mut corrected = self.cloud.clone();
        // Out of the filter for a while; an empty cloud takes no memory.
        let mut next = mem::replace(&mut self.spare, Cloud::empty());
        let mut ancestors = mem::take(&mut self.ancestors);
        next.resize(corrected.len());
        ancestors.resize(corrected.len(), 0);
        let outcome =
            self.apply_in_stages(observation, &mut corrected, &mut next, &mut ancestors, &mut rng);
        if let Ok((belief, _)) = outcome {
            self.cloud = corrected;
            (self.belief, self.rng) = (belief, rng);
        }
        (self.spare, self.ancestors) = (next, ancestors);
        outcome.map(|(_, log_evidence)| log_evidence)
    }

    /// Conditions `cloud`, which holds this filter's.
    fn apply_in_stages(
        &self,
        observation: &Observation<M>,
        cloud: &mut Cloud<N>,
        next: &mut Cloud<N>,
        ancestors: &mut [u32],
        rng: &mut R,
    ) -> Result<(Gaussian<N>, f64), EstimatorError> {
        let mut belief = self.belief;
        let mut left = 1.0;
        let mut log_evidence = 0.0;
        for stage in 1..=MOST_STAGES {
            // At the first stage alone the cloud may be uneven.
            if cloud.weights.effective_sample_size() < KEPT * number(cloud.len()) {
                self.regularise(&belief, cloud, next, ancestors, rng);
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
            self.regularise(&belief, cloud, next, ancestors, rng);
            mem::swap(cloud, next);
        }
        Ok((belief, log_evidence))
    }

    /// Resamples `from` into `next` with the kernel about its own moments.
    fn regularise(
        &self,
        belief: &Gaussian<N>,
        from: &Cloud<N>,
        next: &mut Cloud<N>,
        ancestors: &mut [u32],
        rng: &mut R,
    ) {
        let axes = self.motion.axes();
        let threads = self.workers.threads;
        let own = moments(&from.columns, &from.weights.linear, &axes, threads);
        // A cloud that has collapsed has no moments of its own.
        let belief = Gaussian::new(own, Role::Posterior).unwrap_or(*belief);
        let bandwidth = self.bandwidth_of(from.len());
        let kernel = Kernel::new(belief.mean(), belief.factor(), bandwidth, axes);
        let scratch = next.weights.scratch();
        self.resampling.draw(&from.weights.linear, rng, scratch, ancestors, threads);
        let _ = (self.workers.step)(Step {
            key: rng.next_u64(),
            from: &from.columns,
            to: next.columns.each_mut().map(|column| &mut column[..]),
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

/// The largest exponent, up to `left`, that leaves an effective sample size of `wanted`.
pub(super) fn largest_exponent(left: f64, wanted: f64, mut size: impl FnMut(f64) -> f64) -> f64 {
    let whole = size(left);
    // What does not compare is refused with the weights.
    if whole >= wanted || whole.is_nan() {
        return left;
    }
    // By its logarithm: a cloud a thousand times too wide needs a millionth.
    let mut low = left * LEAST_EXPONENT;
    let mut high = left;
    for _ in 0..HALVINGS {
        let middle = libm::sqrt(low * high);
        if size(middle) < wanted { high = middle } else { low = middle }
    }
    low
}
