//! Particle filters, and the weighted clouds in columns that they are made of.

mod filter;
mod kld;
mod rao_blackwellised;
mod resampling;
mod step;
mod white;

use alloc::vec::Vec;

use foxhunt_core::{
    EstimatorError, MeasurementModel, Observation, Role, State, columns, elementary,
    parameter::{ParameterError, in_range},
};

use crate::{
    count::number,
    vectorised::{self, Kernel},
};

pub use filter::ParticleFilter;
pub use kld::KldSampling;
pub use rao_blackwellised::RaoBlackwellised;
pub use resampling::Resampling;

/// So many particles are worked on at a time: their columns stay in the nearest cache.
const CHUNK: usize = 512;

/// Number of particles down to which work on a cloud is halved.
const BLOCK: usize = 8 * CHUNK;

/// Fewer particles are not worth waking a thread for.
#[cfg(feature = "parallel")]
const LEAST: usize = 8 * BLOCK;

/// The share of its effective sample size that a cloud keeps in each stage.
const KEPT: f64 = 0.5;

/// Bisections of an exponent's logarithm: to a thousandth of it.
const HALVINGS: u32 = 14;

/// Least share of the remaining likelihood that a stage applies.
const LEAST_EXPONENT: f64 = 1e-9;

/// Number of stages after which the remaining likelihood is applied at once. Each narrows a cloud
/// to about half its width: an observation that needs more is one that nothing led to.
const MOST_STAGES: u32 = 40;

/// Weighted states, one column for each component.
#[derive(Clone, Debug)]
struct Cloud<const N: usize> {
    columns: [Vec<f64>; N],
    weights: Weights,
}

impl<const N: usize> Cloud<N> {
    fn len(&self) -> usize {
        self.weights.linear.len()
    }

    /// No particle at all.
    fn empty() -> Self {
        Self { columns: core::array::from_fn(|_| Vec::new()), weights: Weights::none() }
    }

    /// Makes room for `count` particles; what they hold is of no use.
    fn resize(&mut self, count: usize) {
        self.columns.iter_mut().for_each(|column| column.resize(count, 0.0));
        self.weights.resize(count);
    }

    fn state(&self, particle: usize) -> State<N> {
        State::from_fn(|row, _| self.columns[row][particle])
    }

    /// Adds a particle without a weight yet.
    fn push(&mut self, state: &State<N>) {
        self.columns.iter_mut().zip(state.iter()).for_each(|(column, value)| column.push(*value));
        self.weights.resize(self.weights.linear.len() + 1);
    }

    fn set(&mut self, particle: usize, state: &State<N>) {
        for (column, value) in self.columns.iter_mut().zip(state.iter()) {
            column[particle] = *value;
        }
    }
}

/// Weights that sum to 1, and their logarithms: a product of many likelihoods underflows.
#[derive(Clone, Debug)]
struct Weights {
    linear: Vec<f64>,
    log: Vec<f64>,
    /// 1 / Σ w².
    effective_sample_size: f64,
    /// Largest logarithm of each chunk, while weights are made. There is room for whole blocks.
    peaks: Vec<f64>,
}

impl Weights {
    fn even(count: usize) -> Self {
        let mut weights = Self::none();
        weights.resize(count);
        weights.fill_even(Threads::One);
        weights
    }

    fn none() -> Self {
        let linear = Vec::new();
        let log = Vec::new();
        let peaks = Vec::new();
        Self { linear, log, effective_sample_size: 0.0, peaks }
    }

    fn resize(&mut self, count: usize) {
        self.linear.resize(count, 0.0);
        self.log.resize(count, 0.0);
        self.peaks.resize(count.div_ceil(BLOCK) * (BLOCK / CHUNK), 0.0);
    }

    fn fill_even(&mut self, threads: Threads) {
        let share = 1.0 / number(self.linear.len());
        let linear = &mut self.linear[..];
        let log = &mut self.log[..];
        threads.run(Fill { linear, log, share, log_share: libm::log(share) });
        self.effective_sample_size = number(self.linear.len());
    }

    /// Lends the columns until the weights are made again, and two numbers or more for each block.
    fn scratch(&mut self) -> [&mut [f64]; 3] {
        [&mut self.linear, &mut self.log, &mut self.peaks]
    }

    /// 1 / Σ w².
    fn effective_sample_size(&self) -> f64 {
        self.effective_sample_size
    }

    /// Makes the posterior weights of log-likelihoods that stand in `self.log`, `prior` being the
    /// weights so far; returns the log-evidence ln Σ wᵢ p(z | xᵢ).
    ///
    /// # Errors
    ///
    /// An error when a likelihood is NaN or infinite, or none is positive; `self` is then of no
    /// use.
    fn condition(&mut self, prior: &Self, threads: Threads) -> Result<f64, EstimatorError> {
        self.condition_on(prior, &Given, |work| threads.run(work), threads)
    }

    /// Makes the posterior weights of `likelihoods`, on threads.
    fn condition_on<L: Likelihoods>(
        &mut self,
        prior: &Self,
        likelihoods: &L,
        multiply: impl FnOnce(Multiply<'_, L>) -> Evidence,
        threads: Threads,
    ) -> Result<f64, EstimatorError> {
        let Self { linear, log, peaks, .. } = &mut *self;
        let linear = &mut linear[..];
        let log = &mut log[..];
        let peaks = &mut peaks[..];
        let Evidence { best, total } =
            multiply(Multiply { likelihoods, first: 0, prior: &prior.log, linear, log, peaks });
        if total.is_nan() {
            return Err(EstimatorError::NotFinite { role: Role::Expected });
        }
        if best <= f64::NEG_INFINITY {
            return Err(EstimatorError::Impossible { particles: self.log.len() });
        }
        let evidence = best + libm::log(total);
        let Self { linear, log, peaks, .. } = &mut *self;
        let linear = &mut linear[..];
        let log = &mut log[..];
        let peaks = &peaks[..];
        let squares = threads.run(Normalise { best, total, evidence, linear, log, peaks });
        self.effective_sample_size = 1.0 / squares;
        Ok(evidence)
    }
}

/// Makes all weights the same.
struct Fill<'a> {
    linear: &'a mut [f64],
    log: &'a mut [f64],
    share: f64,
    log_share: f64,
}

impl Kernel for Fill<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.linear.fill(self.share);
        self.log.fill(self.log_share);
    }
}

impl Divided for Fill<'_> {
    fn particles(&self) -> usize {
        self.linear.len()
    }

    fn split_at(mut self, particles: usize) -> (Self, Self) {
        let linear = take_first(&mut self.linear, particles);
        let log = take_first(&mut self.log, particles);
        (Self { linear, log, ..self }, self)
    }

    fn join((): (), (): ()) {}
}

/// Log-likelihoods of particles.
trait Likelihoods {
    /// Sets the log-likelihoods of the particles from `first` on; `#[inline(always)]`.
    fn set(&self, first: usize, out: &mut [f64]);
}

/// They are there already.
struct Given;

impl Likelihoods for Given {
    #[inline(always)]
    fn set(&self, _first: usize, _out: &mut [f64]) {}
}

/// Log-likelihoods of a model for the states in columns.
struct Modelled<'a, H, const N: usize, const M: usize> {
    model: &'a H,
    columns: &'a [Vec<f64>; N],
    observation: &'a Observation<M>,
}

impl<H: MeasurementModel<N, M>, const N: usize, const M: usize> Likelihoods
    for Modelled<'_, H, N, M>
{
    #[inline(always)]
    fn set(&self, first: usize, out: &mut [f64]) {
        let columns = columns::rows(self.columns, first..first + out.len());
        self.model.log_likelihoods(columns, self.observation, out);
    }
}

/// The largest of the logarithms, and the sum relative to it, which is NaN where a likelihood is
/// NaN or infinite.
struct Evidence {
    best: f64,
    total: f64,
}

impl Evidence {
    const NONE: Self = Self { best: f64::NEG_INFINITY, total: 0.0 };

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        let best = if other.best > self.best { other.best } else { self.best };
        let relative = |part: Self| match part.total > 0.0 {
            true => part.total * elementary::exp(part.best - best),
            // NaN stays.
            false => part.total,
        };
        Self { best, total: relative(self) + relative(other) }
    }
}

/// Adds log-likelihoods to logarithms of weights, and takes them relative to the largest of each
/// chunk out of the logarithm.
struct Multiply<'a, L> {
    likelihoods: &'a L,
    /// The first particle that it is on.
    first: usize,
    prior: &'a [f64],
    linear: &'a mut [f64],
    log: &'a mut [f64],
    peaks: &'a mut [f64],
}

impl<L: Likelihoods> Kernel for Multiply<'_, L> {
    type Output = Evidence;

    #[inline(always)]
    fn run(self) -> Evidence {
        let mut all = Evidence::NONE;
        let columns = self.log.chunks_mut(CHUNK).zip(self.linear.chunks_mut(CHUNK));
        let chunks = columns.zip(self.prior.chunks(CHUNK)).zip(self.peaks).enumerate();
        for (chunk, (((log, linear), prior), peak)) in chunks {
            self.likelihoods.set(self.first + chunk * CHUNK, log);
            // A particle that was impossible stays so, whatever it makes of this observation.
            log.iter_mut().zip(prior).for_each(|(log, before)| *log += before);
            *peak = vectorised::largest(log);
            let origin = if *peak > f64::NEG_INFINITY { *peak } else { 0.0 };
            for (weight, log) in linear.iter_mut().zip(&*log) {
                *weight = elementary::exp(log - origin);
            }
            all = all.and(Evidence { best: *peak, total: vectorised::sum(linear) });
        }
        all
    }
}

impl<L: Likelihoods> Divided for Multiply<'_, L> {
    fn particles(&self) -> usize {
        self.linear.len()
    }

    fn split_at(mut self, particles: usize) -> (Self, Self) {
        let (before, prior) = self.prior.split_at(particles);
        let linear = take_first(&mut self.linear, particles);
        let log = take_first(&mut self.log, particles);
        let peaks = take_first(&mut self.peaks, particles / CHUNK);
        let first = self.first + particles;
        (Self { prior: before, linear, log, peaks, ..self }, Self { prior, first, ..self })
    }

    fn join(first: Evidence, second: Evidence) -> Evidence {
        first.and(second)
    }
}

/// Divides all weights by their sum; returns the sum of their squares.
struct Normalise<'a> {
    best: f64,
    total: f64,
    evidence: f64,
    linear: &'a mut [f64],
    log: &'a mut [f64],
    peaks: &'a [f64],
}

impl Kernel for Normalise<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let mut squares = 0.0;
        let columns = self.linear.chunks_mut(CHUNK).zip(self.log.chunks_mut(CHUNK));
        for ((linear, log), peak) in columns.zip(self.peaks) {
            let scale = elementary::exp(*peak - self.best) / self.total;
            linear.iter_mut().for_each(|weight| *weight *= scale);
            log.iter_mut().for_each(|log| *log -= self.evidence);
            squares += vectorised::dot(linear, linear);
        }
        squares
    }
}

impl Divided for Normalise<'_> {
    fn particles(&self) -> usize {
        self.linear.len()
    }

    fn split_at(mut self, particles: usize) -> (Self, Self) {
        let linear = take_first(&mut self.linear, particles);
        let log = take_first(&mut self.log, particles);
        let (before, peaks) = self.peaks.split_at(particles / CHUNK);
        (Self { linear, log, peaks: before, ..self }, Self { peaks, ..self })
    }

    fn join(first: f64, second: f64) -> f64 {
        first + second
    }
}

/// Work on the particles of a cloud that can be done in parts, in any order.
trait Divided: Kernel {
    /// Returns the number of particles.
    fn particles(&self) -> usize;

    /// Splits off the work on the first `particles` particles, a multiple of [`BLOCK`].
    fn split_at(self, particles: usize) -> (Self, Self)
    where
        Self: Sized;

    /// Puts together what came of two parts.
    fn join(first: Self::Output, second: Self::Output) -> Self::Output;
}

/// Threads for work that needs no models.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Threads {
    /// Here.
    One,
    /// On all of the current pool.
    #[cfg(feature = "parallel")]
    Pool,
}

impl Threads {
    fn run<W: Divided<Output: Send> + Send>(self, work: W) -> W::Output {
        match self {
            Self::One => one_by_one(work),
            #[cfg(feature = "parallel")]
            Self::Pool => on_threads(work),
        }
    }
}

/// Does one part after the other. Where it is halved depends on the number of particles alone, so
/// that sums have the same bits on any number of threads.
fn one_by_one<W: Divided>(work: W) -> W::Output {
    match middle(&work) {
        None => vectorised::run(work),
        Some(middle) => {
            let (first, second) = work.split_at(middle);
            W::join(one_by_one(first), one_by_one(second))
        }
    }
}

/// Does the parts on the threads of the current pool, if there are enough particles.
#[cfg(feature = "parallel")]
fn on_threads<W: Divided<Output: Send> + Send>(work: W) -> W::Output {
    fn halve<W: Divided<Output: Send> + Send>(work: W) -> W::Output {
        match middle(&work) {
            None => vectorised::run(work),
            Some(middle) => {
                let (first, second) = work.split_at(middle);
                let (first, second) = rayon::join(|| halve(first), || halve(second));
                W::join(first, second)
            }
        }
    }
    if work.particles() < LEAST { one_by_one(work) } else { halve(work) }
}

fn middle(work: &impl Divided) -> Option<usize> {
    let blocks = work.particles().div_ceil(BLOCK);
    (blocks > 1).then_some(blocks / 2 * BLOCK)
}

/// The part of a mutable slice up to `at`; the other one stays.
fn take_first<'a, T>(slice: &mut &'a mut [T], at: usize) -> &'a mut [T] {
    let (first, second) = core::mem::take(slice).split_at_mut(at);
    *slice = second;
    first
}

/// The largest exponent, up to `left`, that leaves an effective sample size of `wanted`.
fn largest_exponent(left: f64, wanted: f64, mut size: impl FnMut(f64) -> f64) -> f64 {
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

/// Checks the share of the particles below which an update is made in stages.
fn check_progressive(share: f64) -> Result<f64, ParameterError> {
    in_range("progressive correction", share, 0.0..=0.5, "in [0, 0.5]")
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn weights_far_below_the_smallest_number_are_still_distinguished() {
        let prior = Weights::even(4);
        let mut posterior = Weights::even(4);
        posterior.log = alloc::vec![-2000.0, -2000.0 + libm::log(3.0), f64::NEG_INFINITY, -3000.0];
        let evidence = posterior.condition(&prior, Threads::One).expect("two are possible");
        assert_abs_diff_eq!(evidence, -2000.0, epsilon = 1e-12);
        let expected = [0.25, 0.75, 0.0, 0.0];
        for (weight, expected) in posterior.linear.iter().zip(expected) {
            assert_abs_diff_eq!(*weight, expected, epsilon = 1e-12);
        }
        assert_abs_diff_eq!(posterior.effective_sample_size(), 1.6, epsilon = 1e-12);
        // What is left at −∞ makes no NaN the next time.
        let mut again = Weights::even(4);
        again.log = alloc::vec![-1.0; 4];
        let evidence = again.condition(&posterior, Threads::One).expect("possible");
        assert_abs_diff_eq!(evidence, -1.0, epsilon = 1e-12);
        assert!(again.linear.iter().all(|w| w.is_finite()));
    }

    #[test]
    fn likelihoods_that_are_none_are_refused() {
        let prior = Weights::even(2);
        let condition = |logs: [f64; 2]| {
            let mut weights = Weights::even(2);
            weights.log.copy_from_slice(&logs);
            weights.condition(&prior, Threads::One)
        };
        let not_finite = Err(EstimatorError::NotFinite { role: Role::Expected });
        assert_eq!(condition([0.0, f64::NAN]), not_finite);
        assert_eq!(condition([0.0, f64::INFINITY]), not_finite);
        let impossible = Err(EstimatorError::Impossible { particles: 2 });
        assert_eq!(condition([f64::NEG_INFINITY; 2]), impossible);
    }
}
