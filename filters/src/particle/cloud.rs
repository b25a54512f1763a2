use alloc::vec::Vec;

use foxhunt_core::{EstimatorError, MeasurementModel, Observation, Role, State, elementary};

use super::white::CHUNK;
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
    /// While they are made: the largest logarithm of each chunk.
    peaks: Vec<f64>,
}

impl Weights {
    pub(super) fn even(count: usize) -> Self {
        let mut weights = Self::none();
        weights.resize(count);
        weights.fill_even();
        weights
    }

    fn none() -> Self {
        let (linear, log, peaks) = (Vec::new(), Vec::new(), Vec::new());
        Self { linear, log, effective_sample_size: 0.0, peaks }
    }

    fn resize(&mut self, count: usize) {
        self.linear.resize(count, 0.0);
        self.log.resize(count, 0.0);
        self.peaks.resize(count.div_ceil(CHUNK), 0.0);
    }

    pub(super) fn fill_even(&mut self) {
        let share = 1.0 / number(self.linear.len());
        self.linear.fill(share);
        self.log.fill(libm::log(share));
        self.effective_sample_size = number(self.linear.len());
    }

    /// Its columns, for other use until it is made anew.
    pub(super) fn scratch(&mut self) -> [&mut [f64]; 2] {
        [&mut self.linear, &mut self.log]
    }

    /// 1 / Σ w².
    pub(super) fn effective_sample_size(&self) -> f64 {
        self.effective_sample_size
    }

    /// Makes the posterior weights, `prior` being the weights so far; returns the log-evidence
    /// ln Σ wᵢ p(z | xᵢ). Where `likelihoods` are [`Given`], they stand in `self.log`.
    ///
    /// # Errors
    ///
    /// When a likelihood is NaN or infinite, or none is positive; `self` is then of no use.
    pub(super) fn condition(
        &mut self,
        prior: &Self,
        likelihoods: &impl Likelihoods,
    ) -> Result<f64, EstimatorError> {
        let weights = &mut *self;
        let (best, total) = vectorised::run(Multiply { likelihoods, prior: &prior.log, weights });
        if total.is_nan() {
            return Err(EstimatorError::NotFinite { role: Role::Expected });
        }
        if best <= f64::NEG_INFINITY {
            return Err(EstimatorError::Impossible { particles: self.log.len() });
        }
        let evidence = best + libm::log(total);
        let weights = &mut *self;
        self.effective_sample_size =
            1.0 / vectorised::run(Normalise { best, total, evidence, weights });
        Ok(evidence)
    }
}

/// Log-likelihoods of particles.
pub(super) trait Likelihoods {
    /// Sets those of the particles from `first` on; `#[inline(always)]`.
    fn set(&self, first: usize, out: &mut [f64]);
}

/// They are there already.
pub(super) struct Given;

impl Likelihoods for Given {
    #[inline(always)]
    fn set(&self, _first: usize, _out: &mut [f64]) {}
}

/// Those of a model for the states in columns.
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

/// Adds log-likelihoods to logarithms of weights, and takes them relative to the largest of each
/// chunk out of the logarithm. Returns the largest and the sum relative to it, which is NaN where
/// a likelihood is NaN or infinite.
struct Multiply<'a, L> {
    likelihoods: &'a L,
    prior: &'a [f64],
    weights: &'a mut Weights,
}

impl<L: Likelihoods> Kernel for Multiply<'_, L> {
    type Output = (f64, f64);

    #[inline(always)]
    fn run(self) -> (f64, f64) {
        let Weights { linear, log, peaks, .. } = self.weights;
        let (mut best, mut total) = (f64::NEG_INFINITY, 0.0);
        let columns = log.chunks_mut(CHUNK).zip(linear.chunks_mut(CHUNK));
        let chunks = columns.zip(self.prior.chunks(CHUNK)).zip(peaks).enumerate();
        for (chunk, (((log, linear), prior), peak)) in chunks {
            self.likelihoods.set(chunk * CHUNK, log);
            // A particle that was impossible stays so, whatever it makes of this observation.
            log.iter_mut().zip(prior).for_each(|(log, before)| *log += before);
            *peak = vectorised::largest(log);
            let origin = if *peak > f64::NEG_INFINITY { *peak } else { 0.0 };
            for (weight, log) in linear.iter_mut().zip(&*log) {
                *weight = elementary::exp(log - origin);
            }
            let sum = vectorised::sum(linear);
            if *peak > best {
                total *= elementary::exp(best - *peak);
                best = *peak;
            }
            total += if sum > 0.0 { sum * elementary::exp(*peak - best) } else { sum };
        }
        (best, total)
    }
}

/// Divides all weights by their sum; returns the sum of their squares.
struct Normalise<'a> {
    best: f64,
    total: f64,
    evidence: f64,
    weights: &'a mut Weights,
}

impl Kernel for Normalise<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let Weights { linear, log, peaks, .. } = self.weights;
        let mut squares = 0.0;
        let columns = linear.chunks_mut(CHUNK).zip(log.chunks_mut(CHUNK));
        for ((linear, log), peak) in columns.zip(peaks) {
            let scale = elementary::exp(*peak - self.best) / self.total;
            linear.iter_mut().for_each(|weight| *weight *= scale);
            log.iter_mut().for_each(|log| *log -= self.evidence);
            squares += vectorised::dot(linear, linear);
        }
        squares
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
        let evidence = posterior.condition(&prior, &Given).expect("two are possible");
        assert!((evidence + 2000.0).abs() < 1e-12, "ln(¼ (1 + 3)) = 0: {evidence}");
        let expected = [0.25, 0.75, 0.0, 0.0];
        for (weight, expected) in posterior.linear.iter().zip(expected) {
            assert!((weight - expected).abs() < 1e-12, "{weight}, not {expected}");
        }
        assert!((posterior.effective_sample_size() - 1.6).abs() < 1e-12);
        // What is left at −∞ makes no NaN the next time.
        let mut again = Weights::even(4);
        again.log = alloc::vec![-1.0; 4];
        let evidence = again.condition(&posterior, &Given).expect("possible");
        assert!((evidence + 1.0).abs() < 1e-12);
        assert!(again.linear.iter().all(|w| w.is_finite()));
    }

    #[test]
    fn likelihoods_that_are_none_are_refused() {
        let prior = Weights::even(2);
        let condition = |logs: [f64; 2]| {
            let mut weights = Weights::even(2);
            weights.log.copy_from_slice(&logs);
            weights.condition(&prior, &Given)
        };
        let not_finite = Err(EstimatorError::NotFinite { role: Role::Expected });
        assert_eq!(condition([0.0, f64::NAN]), not_finite);
        assert_eq!(condition([0.0, f64::INFINITY]), not_finite);
        let impossible = Err(EstimatorError::Impossible { particles: 2 });
        assert_eq!(condition([f64::NEG_INFINITY; 2]), impossible);
    }
}
