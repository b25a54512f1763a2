use alloc::vec::Vec;

use foxhunt_core::{EstimatorError, MeasurementModel, Observation, Role, State, elementary};

use super::{
    divided::{BLOCK, Divided, Threads, take_first},
    white::CHUNK,
};
use crate::{
    count::number,
    vectorised::{self, Kernel},
};

/// Weighted states, one column for each component.
#[derive(Clone, Debug)]
pub(super) struct Cloud<const N: usize> {
    pub(super) columns: [Vec<f64>; N],
    pub(super) weights: Weights,
}

impl<const N: usize> Cloud<N> {
    pub(super) fn len(&self) -> usize {
        self.weights.linear.len()
    }

    /// No particle at all.
    pub(super) fn empty() -> Self {
        Self { columns: core::array::from_fn(|_| Vec::new()), weights: Weights::none() }
    }

    /// Makes room for `count` particles; what they hold is of no use.
    pub(super) fn resize(&mut self, count: usize) {
        self.columns.iter_mut().for_each(|column| column.resize(count, 0.0));
        self.weights.resize(count);
    }

    pub(super) fn state(&self, particle: usize) -> State<N> {
        State::from_fn(|row, _| self.columns[row][particle])
    }

    /// Adds a particle without a weight yet.
    pub(super) fn push(&mut self, state: &State<N>) {
        self.columns.iter_mut().zip(state.iter()).for_each(|(column, value)| column.push(*value));
        self.weights.resize(self.weights.linear.len() + 1);
    }

    pub(super) fn set(&mut self, particle: usize, state: &State<N>) {
        for (column, value) in self.columns.iter_mut().zip(state.iter()) {
            column[particle] = *value;
        }
    }
}

/// Weights that sum to 1, and their logarithms: a product of many likelihoods underflows.
#[derive(Clone, Debug)]
pub(super) struct Weights {
    pub(super) linear: Vec<f64>,
    pub(super) log: Vec<f64>,
    /// 1 / Σ w².
    effective_sample_size: f64,
    /// Largest logarithm of each chunk, while weights are made. There is room for whole blocks.
    peaks: Vec<f64>,
}

impl Weights {
    pub(super) fn even(count: usize) -> Self {
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

    pub(super) fn fill_even(&mut self, threads: Threads) {
        let share = 1.0 / number(self.linear.len());
        let linear = &mut self.linear[..];
        let log = &mut self.log[..];
        threads.run(Fill { linear, log, share, log_share: libm::log(share) });
        self.effective_sample_size = number(self.linear.len());
    }

    /// Lends the columns until the weights are made again, and two numbers or more for each block.
    pub(super) fn scratch(&mut self) -> [&mut [f64]; 3] {
        [&mut self.linear, &mut self.log, &mut self.peaks]
    }

    /// 1 / Σ w².
    pub(super) fn effective_sample_size(&self) -> f64 {
        self.effective_sample_size
    }

    /// Makes the posterior weights of log-likelihoods that stand in `self.log`, `prior` being the
    /// weights so far; returns the log-evidence ln Σ wᵢ p(z | xᵢ).
    ///
    /// # Errors
    ///
    /// When a likelihood is NaN or infinite, or none is positive; `self` is then of no use.
    pub(super) fn condition(
        &mut self,
        prior: &Self,
        threads: Threads,
    ) -> Result<f64, EstimatorError> {
        self.condition_on(prior, &Given, |work| threads.run(work), threads)
    }

    /// Makes the posterior weights of `likelihoods`, on threads.
    pub(super) fn condition_on<L: Likelihoods>(
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
pub(super) trait Likelihoods {
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
pub(super) struct Modelled<'a, H, const N: usize, const M: usize> {
    pub(super) model: &'a H,
    pub(super) columns: &'a [Vec<f64>; N],
    pub(super) observation: &'a Observation<M>,
}

impl<H: MeasurementModel<N, M>, const N: usize, const M: usize> Likelihoods
    for Modelled<'_, H, N, M>
{
    #[inline(always)]
    fn set(&self, first: usize, out: &mut [f64]) {
        let columns = self.columns.each_ref().map(|column| &column[first..first + out.len()]);
        self.model.log_likelihoods(columns, self.observation, out);
    }
}

/// The largest of the logarithms, and the sum relative to it, which is NaN where a likelihood is
/// NaN or infinite.
pub(super) struct Evidence {
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
pub(super) struct Multiply<'a, L> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_far_below_the_smallest_number_are_still_distinguished() {
        let prior = Weights::even(4);
        let mut posterior = Weights::even(4);
        posterior.log = alloc::vec![-2000.0, -2000.0 + libm::log(3.0), f64::NEG_INFINITY, -3000.0];
        let evidence = posterior.condition(&prior, Threads::One).expect("two are possible");
        assert!((evidence + 2000.0).abs() < 1e-12, "ln(¼ (1 + 3)) = 0: {evidence}");
        let expected = [0.25, 0.75, 0.0, 0.0];
        for (weight, expected) in posterior.linear.iter().zip(expected) {
            assert!((weight - expected).abs() < 1e-12, "{weight}, not {expected}");
        }
        assert!((posterior.effective_sample_size() - 1.6).abs() < 1e-12);
        // What is left at −∞ makes no NaN the next time.
        let mut again = Weights::even(4);
        again.log = alloc::vec![-1.0; 4];
        let evidence = again.condition(&posterior, Threads::One).expect("possible");
        assert!((evidence + 1.0).abs() < 1e-12);
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
