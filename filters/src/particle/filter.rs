use alloc::{vec, vec::Vec};

use foxhunt_core::{Axis, Estimate, EstimatorError, MeasurementModel, MotionModel, Role, State};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use super::{
    cloud::{Cloud, Weights, moments},
    resampling::Resampling,
};
use crate::{Gaussian, count::number};

/// The bootstrap particle filter (Gordon, Salmond & Smith 1993).
///
/// Owns its generator: one stream, so two filters made alike run alike. Particles lie in columns,
/// one for each component of the state; all memory is taken when the filter is made.
///
/// The cloud is resampled where its effective sample size has fallen below a share of its
/// particles, at the start of the next `predict`: only motion noise sets the copies of a particle
/// apart, so that between two updates at one time the weights are the better belief.
#[derive(Clone, Debug)]
pub struct ParticleFilter<F, H, R, const N: usize, const M: usize> {
    pub(super) motion: F,
    pub(super) measurement: H,
    pub(super) rng: R,
    pub(super) cloud: Cloud<N>,
    /// The cloud's moments.
    pub(super) belief: Gaussian<N>,
    /// Where a step is prepared, to be taken as a whole or not at all.
    pub(super) spare: Cloud<N>,
    pub(super) ancestors: Vec<usize>,
    pub(super) resampling: Resampling,
    pub(super) threshold: f64,
}

impl<F, H, R, const N: usize, const M: usize> ParticleFilter<F, H, R, N, M>
where
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
    R: Rng + Clone,
{
    /// A filter of `particles` drawn from the Gaussian `prior`; resamples systematically below
    /// half of them.
    ///
    /// # Errors
    ///
    /// When the prior is not finite or its covariance not symmetric and positive definite;
    /// [`EstimatorError::Parameter`] when there are not at least N + 1 particles.
    pub fn new(
        motion: F,
        measurement: H,
        prior: Estimate<N>,
        particles: usize,
        mut rng: R,
    ) -> Result<Self, EstimatorError> {
        let prior = Gaussian::new(prior, Role::Prior)?;
        let draw = |_| prior.mean() + prior.factor() * white(&mut rng);
        let samples: Vec<State<N>> = (0..particles).map(draw).collect();
        Self::from_samples(motion, measurement, &samples, rng)
    }

    /// A filter whose particles are `samples`, all of one weight; resamples systematically below
    /// half of them.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when there are not at least N + 1 samples;
    /// when they are not finite or lie in a plane of fewer than N dimensions.
    pub fn from_samples(
        motion: F,
        measurement: H,
        samples: &[State<N>],
        rng: R,
    ) -> Result<Self, EstimatorError> {
        let count = samples.len();
        if count <= N {
            return Err(EstimatorError::Parameter {
                name: "particles",
                value: number(count),
                requirement: "more than the state has components",
            });
        }
        let columns = core::array::from_fn(|row| samples.iter().map(|x| x[row]).collect());
        let cloud = Cloud { columns, weights: Weights::even(count) };
        let belief = moments(&cloud.columns, &cloud.weights.linear, &motion.axes());
        Ok(Self {
            motion,
            measurement,
            rng,
            belief: Gaussian::new(belief, Role::Prior)?,
            spare: cloud.clone(),
            cloud,
            ancestors: vec![0; count],
            resampling: Resampling::default(),
            threshold: 0.5,
        })
    }

    /// The same filter with another way to draw ancestors.
    #[must_use]
    pub fn with_resampling(self, resampling: Resampling) -> Self {
        Self { resampling, ..self }
    }

    /// The same filter, resampling where the effective sample size is below this share of the
    /// particles: 0 never does, 1 does after every update that tells particles apart.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when it is not in [0, 1].
    pub fn with_resampling_threshold(self, threshold: f64) -> Result<Self, EstimatorError> {
        if !(0.0..=1.0).contains(&threshold) {
            return Err(EstimatorError::Parameter {
                name: "resampling threshold",
                value: threshold,
                requirement: "in [0, 1]",
            });
        }
        Ok(Self { threshold, ..self })
    }

    /// 1 / Σ w²: how many particles of equal weight would tell as much.
    #[must_use]
    pub fn effective_sample_size(&self) -> f64 {
        self.cloud.weights.effective_sample_size()
    }

    /// Makes `spare` the next generation of the cloud: resampled if that is due, then moved.
    pub(super) fn prepare_moved(&mut self, dt: f64, rng: &mut R) {
        let count = self.ancestors.len();
        let weights = &self.cloud.weights;
        if weights.effective_sample_size() < self.threshold * number(count) {
            self.resampling.draw(&weights.linear, rng, &mut self.ancestors);
            self.spare.weights.fill_even();
        } else {
            self.ancestors.iter_mut().enumerate().for_each(|(i, ancestor)| *ancestor = i);
            self.spare.weights.linear.copy_from_slice(&weights.linear);
            self.spare.weights.log.copy_from_slice(&weights.log);
        }
        let axes = self.motion.axes();
        for (i, &ancestor) in self.ancestors.iter().enumerate() {
            let before = State::from_fn(|row, _| self.cloud.columns[row][ancestor]);
            let noise = self.motion.noise_factor(&before, dt) * white(rng);
            let moved = self.motion.propagate(&before, dt) + noise;
            let moved = Axis::difference(&axes, &moved, &State::zeros());
            for (column, value) in self.spare.columns.iter_mut().zip(moved.iter()) {
                column[i] = *value;
            }
        }
    }
}

/// A draw from N(0, I).
fn white<R: Rng, const N: usize>(rng: &mut R) -> State<N> {
    State::from_fn(|_, _| rng.sample(StandardNormal))
}
