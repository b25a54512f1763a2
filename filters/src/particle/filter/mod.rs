//! The particle filter: its state, its making and its resampling.

mod estimator;
mod smoothing;

use alloc::{vec, vec::Vec};

use foxhunt_core::{
    Axis, Covariance, Estimate, EstimatorError, MeasurementModel, MotionModel, Role, State,
    columns,
    parameter::{in_range, require},
};
use rand::{Rng, RngExt};

use super::{
    Cloud, Weights, check_progressive,
    kld::KldSampling,
    resampling::Resampling,
    step::{Step, Workers, moments},
    white::{Kernel, silverman, white},
};
use crate::{Gaussian, Reinitialise, count::number};

/// The bootstrap particle filter (Gordon, Salmond & Smith 1993), its resampling regularised.
///
/// Owns its generator, which draws a key for each step; the step's random numbers are a hash of
/// that (SplitMix64, Steele, Lea & Flood 2014). So two filters made alike run alike. Any generator
/// of the crate `rand` will do, `StdRng` too. `Xoshiro256PlusPlus` of `rand` gives the same numbers
/// in every release and on every processor, and a filter over it is `Clone`. A refused step leaves
/// the belief as it was; the generator may have drawn for it.
///
/// ```
/// use foxhunt_core::{
///     Estimate, Estimator, MeasurementModel, Observation, Pose, Quantity, RandomWalk,
/// };
/// use foxhunt_filters::ParticleFilter;
/// use nalgebra::{Matrix1, Vector1, Vector2};
/// use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};
///
/// struct GroundRange;
///
/// impl MeasurementModel<2, 1> for GroundRange {
///     fn quantities(&self) -> [Quantity; 1] {
///         [Quantity::RANGE]
///     }
///     fn expected(&self, state: &Vector2<f64>, receiver: &Pose) -> Vector1<f64> {
///         Vector1::new((state - receiver.position.xy()).norm())
///     }
/// }
///
/// let prior = Estimate::isotropic(Vector2::new(10.0, 0.0), 20.0);
/// let rng = Xoshiro256PlusPlus::seed_from_u64(1);
/// let mut cloud = ParticleFilter::new(RandomWalk::uniform(0.1), GroundRange, prior, 2000, rng)?;
/// for (east, north, range) in [(0.0, 0.0, 50.0), (60.0, 0.0, 50.0), (30.0, -20.0, 60.0)] {
///     let receiver = Pose::at(east, north, 0.0);
///     let range = Vector1::new(range);
///     cloud.predict(1.0)?;
///     let _ = cloud.update(&Observation::new(0.0, receiver, range, Matrix1::new(1.0))?)?;
/// }
/// assert!((cloud.estimate().mean - Vector2::new(30.0, 40.0)).norm() < 5.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// Particles lie in columns, one for each component of the state, and are worked on by columns
/// ([`MotionModel::move_columns`], [`MeasurementModel::log_likelihoods`]). All memory is taken when
/// the filter is made, 16 N + 36 bytes for each particle, unless its size adapts; an update in
/// stages takes a third cloud while it lasts.
///
/// The cloud is resampled where its effective sample size has fallen below a share of its
/// particles, at the start of the next `predict`: between two updates at one time copies would
/// add nothing to the weights.
///
/// The motion noise of a nearly still target does not set the copies of a particle apart; the
/// cloud would thin out to a few points and the filter be sure of itself. So each copy is drawn
/// from a kernel about its ancestor (Musso, Oudjane & Le Gland 2001), shrunk towards the mean so
/// that the cloud keeps both its moments (Liu & West 2001):
/// x' = x̂ + √(1 − h²) (x ⊖ x̂) + h L ξ. The bandwidth h is Silverman's (1986, §4.3.2),
/// (4 / (N + 2))^(1 / (N + 4)) n^(−1 / (N + 4)): 0.28 for 2000 particles in the plane. A
/// bandwidth of 0 is the plain bootstrap filter; it needs a target that drifts.
///
/// A sharp observation of a broad belief would leave a handful of particles. Where the effective
/// sample size after an update would be below a tenth of the particles, the likelihood is applied
/// in stages, p(z | x)^φ with Σ φ = 1, each of which keeps half of it, with a resampling by the
/// kernel in between: progressive correction (Musso, Oudjane & Le Gland 2001).
///
/// The normalised innovation squared of an update is that of every k-th particle of a large cloud,
/// 256 or more, shifted and stretched to the moments of all.
#[derive(Clone, Debug)]
pub struct ParticleFilter<F, H, R, const N: usize, const M: usize> {
    motion: F,
    measurement: H,
    rng: R,
    cloud: Cloud<N>,
    /// The cloud's moments.
    belief: Gaussian<N>,
    /// Buffer where a step is prepared, to be taken as a whole or not at all.
    spare: Cloud<N>,
    ancestors: Vec<u32>,
    resampling: Resampling,
    threshold: f64,
    /// Silverman's unless given.
    bandwidth: Option<f64>,
    size: Option<KldSampling<N>>,
    /// Below this share of its particles an update is made in stages.
    progressive: f64,
    workers: Workers<F, H, N, M>,
}

impl<F, H, R, const N: usize, const M: usize> ParticleFilter<F, H, R, N, M>
where
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
    R: Rng,
{
    /// A filter of `particles` drawn from the Gaussian `prior`; resamples systematically below
    /// half of them.
    ///
    /// # Errors
    ///
    /// An error when the prior is not finite or its covariance not symmetric and positive definite;
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
        require(count > N, "particles", number(count), "more than the state has components")?;
        require(u32::try_from(count).is_ok(), "particles", number(count), "below 2³²")?;
        let columns = core::array::from_fn(|row| samples.iter().map(|x| x[row]).collect());
        let cloud = Cloud { columns, weights: Weights::even(count) };
        let workers = Workers::one();
        let axes = motion.axes();
        let weights = &cloud.weights.linear;
        let belief = moments(&cloud.columns, weights, &axes, workers.threads);
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
            bandwidth: None,
            size: None,
            progressive: 0.1,
            workers,
        })
    }

    /// Sets the scheme for drawing ancestors.
    #[must_use]
    pub fn with_resampling(self, resampling: Resampling) -> Self {
        Self { resampling, ..self }
    }

    /// Sets the share of the particles below which the effective sample size leads to resampling: 0
    /// never does, 1 does after every update that distinguishes particles.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when it is not in [0, 1].
    pub fn with_resampling_threshold(self, threshold: f64) -> Result<Self, EstimatorError> {
        in_range("resampling threshold", threshold, 0.0..=1.0, "in [0, 1]")?;
        Ok(Self { threshold, ..self })
    }

    /// Sets the kernel bandwidth, in standard deviations of the cloud: 0 for plain copies, less
    /// than Silverman's for a belief in several places.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when it is not in [0, 1).
    pub fn with_kernel_bandwidth(self, bandwidth: f64) -> Result<Self, EstimatorError> {
        let inside = (0.0..1.0).contains(&bandwidth);
        require(inside, "kernel bandwidth", bandwidth, "in [0, 1)")?;
        Ok(Self { bandwidth: Some(bandwidth), ..self })
    }

    /// Adapts the number of particles: counts them again at every resampling, and resamples too
    /// where there are more than twice or less than half as many as needed. Ancestors are then
    /// drawn independently, whatever the scheme. The bandwidth follows their number unless it was
    /// given. The filter starts with the particles that it was made with.
    #[must_use]
    pub fn with_adaptive_size(self, size: KldSampling<N>) -> Self {
        Self { size: Some(size), ..self }
    }

    /// Sets the share of the particles below which correction is progressive, 0.1 unless given; 0
    /// never does it.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when it is not in [0, 0.5].
    pub fn with_progressive_correction(self, share: f64) -> Result<Self, EstimatorError> {
        Ok(Self { progressive: check_progressive(share)?, ..self })
    }

    /// Works on large clouds, of 32 768 particles or more, on all threads of the rayon pool that
    /// the filter is stepped in. Its numbers are the same to the bit on any number of threads.
    /// Adaptive sizes, stratified and residual draws, and likelihoods applied in stages stay on one
    /// thread.
    #[cfg(feature = "parallel")]
    #[must_use]
    pub fn with_threads(self) -> Self
    where
        F: Sync,
        H: Sync,
    {
        Self { workers: Workers::pool(), ..self }
    }

    /// Returns the number of particles.
    #[must_use]
    pub fn particles(&self) -> usize {
        self.cloud.len()
    }

    /// 1 / Σ w²: how many particles of equal weight would be as good.
    #[must_use]
    pub fn effective_sample_size(&self) -> f64 {
        self.cloud.weights.effective_sample_size()
    }

    /// The moments of states in columns.
    fn moments(&self, columns: &[Vec<f64>; N], weights: &Weights) -> Estimate<N> {
        moments(columns, &weights.linear, &self.motion.axes(), self.workers.threads)
    }

    /// The belief of a cloud with these moments and weights.
    ///
    /// A cloud of effective size k misses the k-th part of its spread, all of it if one particle
    /// has all the weight. So the k-th part of what one particle stands for is added, the n-th
    /// part of the volume of the belief so far: P n^(−2/N). That is next to nothing as long as
    /// the cloud is sound, and keeps a covariance where it has collapsed, which its effective
    /// sample size shows.
    fn belief_of(
        &self,
        mut belief: Estimate<N>,
        weights: &Weights,
    ) -> Result<Gaussian<N>, EstimatorError> {
        let cell = libm::pow(number(weights.linear.len()), -2.0 / number(N));
        // Nothing as long as the weights are even; a collapsed cloud keeps the least that f64 can
        // factor beside it.
        let even = 1.0 / number(weights.linear.len());
        let missed = cell * libm::fmax(1.0 / weights.effective_sample_size() - even, 1e-6);
        belief.covariance += self.belief.estimate().covariance * missed;
        Gaussian::new(belief, Role::Posterior)
    }

    /// Visits all particles of a small cloud or one whose weights are uneven, and else every k-th,
    /// 256 or more, shifted and stretched to the moments of the cloud.
    fn visit_some(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        let weights = &self.cloud.weights.linear;
        let count = self.cloud.len();
        let sound = self.effective_sample_size() >= 0.25 * number(count);
        let stride = if sound { (count / 256).max(1) } else { 1 };
        let axes = self.motion.axes();
        let centre = self.belief.mean();
        let some = || weights.iter().enumerate().step_by(stride);
        let total: f64 = some().map(|(_, weight)| weight).sum();
        let deviation = |i| Axis::difference(&axes, &self.cloud.state(i), centre);
        let mean = some().fold(State::zeros(), |sum: State<N>, (i, w)| sum + deviation(i) * *w);
        let mean = mean / total;
        let mut covariance = Covariance::<N>::zeros();
        for (i, weight) in some().filter(|_| stride > 1) {
            let off = deviation(i) - mean;
            covariance += off * (off * (weight / total)).transpose();
        }
        // S L = F, of the factors of some and of all: S takes the moments of some to those of all.
        let factor = self.belief.factor().transpose();
        let own = covariance.cholesky().filter(|_| stride > 1);
        let Some(stretch) = own.and_then(|own| own.l_dirty().tr_solve_lower_triangular(&factor))
        else {
            weights.iter().enumerate().for_each(|(i, w)| visit(&self.cloud.state(i), *w));
            return;
        };
        let stretch = stretch.transpose();
        for (i, weight) in some() {
            visit(&(centre + stretch * (deviation(i) - mean)), weight / total);
        }
    }

    fn bandwidth_of(&self, particles: usize) -> f64 {
        self.bandwidth.unwrap_or_else(|| silverman(N, particles))
    }

    /// Makes the columns of `spare` the next generation of the cloud: resampled if that is due,
    /// then moved. Returns true if its weights are new too, and its moments where known.
    fn prepare_moved(&mut self, dt: f64) -> (bool, Option<Estimate<N>>) {
        let count = self.cloud.len();
        let due = self.effective_sample_size() < self.threshold * number(count);
        if let Some(size) = self.size
            && (due || self.is_off(&size))
        {
            self.prepare_as_many_as(&size, dt);
            return (true, None);
        }
        let kernel = self.kernel().filter(|_| due);
        self.spare.resize(count);
        if due {
            self.ancestors.resize(count, 0);
            let weights = &self.cloud.weights.linear;
            let scratch = self.spare.weights.scratch();
            let threads = self.workers.threads;
            self.resampling.draw(weights, &mut self.rng, scratch, &mut self.ancestors, threads);
            self.spare.weights.fill_even(threads);
        }
        let weights = if due { &self.spare.weights } else { &self.cloud.weights };
        let moments = (self.workers.step)(Step {
            key: self.rng.next_u64(),
            from: &self.cloud.columns,
            to: columns::slices_mut(&mut self.spare.columns),
            first: 0,
            ancestors: due.then_some(&self.ancestors[..]),
            kernel: kernel.as_ref(),
            motion: Some((&self.motion, dt)),
            axes: self.motion.axes(),
            weights: Some(&weights.linear),
        });
        (due, moments.map(|moments| moments.estimate()))
    }

    /// Returns true if there are more than twice or less than half the particles that are needed.
    /// Particles that ten resamplings would not take once occupy no bin.
    fn is_off(&self, size: &KldSampling<N>) -> bool {
        let mut bins = size.bins();
        let count = self.cloud.len();
        for (i, weight) in self.cloud.weights.linear.iter().enumerate() {
            if weight * number(count) >= 0.1 {
                bins.add(&self.cloud.state(i));
            }
        }
        let wanted = size.particles(bins.count());
        wanted > 2 * count || count > 2 * wanted
    }

    /// Prepares a resampled and moved cloud, drawn one by one until there are enough (Fox 2003,
    /// table 3).
    fn prepare_as_many_as(&mut self, size: &KldSampling<N>, dt: f64) {
        let kernel = self.kernel();
        let mut reach = 0.0;
        let sums: Vec<f64> = self
            .cloud
            .weights
            .linear
            .iter()
            .map(|w| {
                reach += w;
                reach
            })
            .collect();
        let mut bins = size.bins();
        let mut wanted = size.particles(0);
        self.spare.resize(0);
        while self.spare.len() < wanted {
            // What rounds beyond the last sum is the last particle that has a weight.
            let mark = self.rng.random::<f64>() * reach;
            let ancestor = sums.partition_point(|sum| *sum <= mark);
            let state = self.cloud.state(ancestor.min(sums.len() - 1));
            let moved = self.moved(state, kernel.as_ref(), dt);
            self.spare.push(&moved);
            if bins.add(&moved) {
                wanted = size.particles(bins.count());
            }
        }
        self.spare.weights.fill_even(self.workers.threads);
    }

    fn kernel(&self) -> Option<Kernel<N>> {
        let mean = self.belief.mean();
        let factor = self.belief.factor();
        Kernel::new(mean, factor, self.bandwidth_of(self.cloud.len()), self.motion.axes())
    }

    /// A particle set apart from its ancestor, if there is a kernel, and then moved.
    fn moved(&mut self, ancestor: State<N>, kernel: Option<&Kernel<N>>, dt: f64) -> State<N> {
        let rng = &mut self.rng;
        let state = kernel.map_or(ancestor, |kernel| kernel.draw(&ancestor, rng));
        let noise = self.motion.noise_factor(&state, dt) * white(&mut self.rng);
        let moved = self.motion.propagate(&state, dt) + noise;
        Axis::difference(&self.motion.axes(), &moved, &State::zeros())
    }
}

/// Draws the cloud again: what was not Gaussian in it is lost.
impl<F, H, R, const N: usize, const M: usize> Reinitialise<N> for ParticleFilter<F, H, R, N, M>
where
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
    R: Rng,
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
