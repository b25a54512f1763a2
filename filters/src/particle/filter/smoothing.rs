//! Backward simulation of a cloud.

use alloc::vec::Vec;

use foxhunt_core::{
    Axis, Covariance, Estimate, EstimatorError, MeasurementModel, MotionModel, Smooth, State,
    elementary,
};
use rand::{Rng, RngExt};

use super::ParticleFilter;
use crate::{Passage, count::number, particle::white::white};

/// The most states of a smoothed cloud: each is weighed against every particle of the earlier one.
/// The error of a smoothed mean is then 0.045 σ.
const MOST: usize = 500;

/// A particle's kernel, and where the motion takes it.
struct Onward<const N: usize> {
    /// ln w − ½ ln |S|.
    log: f64,
    middle: State<N>,
    passage: Passage<N>,
    /// The inverse of the lower triangular root of S.
    white: Covariance<N>,
}

/// Backward simulation (Godsill, Doucet & West 2004): for each of up to 500 states of the later
/// cloud an earlier one is drawn. The smoothed cloud is of one weight. Each step costs 500
/// densities for every particle.
///
/// The earlier belief is the density that the filter itself resamples from: a Gaussian of the
/// kernel's bandwidth about each particle. So a later state x₊ comes from particle i with the
/// weight wᵢ N(x₊; f(mᵢ), S), S = F h² P Fᵀ + Q, and the earlier state is drawn from
/// that Gaussian given x₊. Without a kernel only the few particles count from which the motion's
/// noise reaches x₊, and the smoothed cloud would be over-confident. A plain cloud (bandwidth 0)
/// needs noise in every component of the state and is refused without it.
impl<F, H, R, const N: usize, const M: usize> Smooth<N, M> for ParticleFilter<F, H, R, N, M>
where
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
    R: Rng + Clone,
{
    fn smooth(&mut self, later: &Self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)?;
        // One stream all the way back: the generators of successive copies differ by a few numbers,
        // so that their draws would not be independent.
        let mut rng = later.rng.clone();
        let drawn = later.drawn(later.cloud.len().min(MOST), &mut rng);
        if drawn.len() <= N {
            return Err(EstimatorError::Impossible { particles: later.cloud.len() });
        }
        let chosen = match dt > 0.0 {
            true => self.earlier(&drawn, dt, &mut rng)?,
            // No time, no motion: the later cloud is of the same instant.
            false => drawn,
        };
        let mut cloud = self.cloud.clone();
        cloud.resize(chosen.len());
        chosen.iter().enumerate().for_each(|(i, state)| cloud.set(i, state));
        cloud.weights.fill_even(self.workers.threads);
        let belief = self.moments(&cloud.columns, &cloud.weights);
        self.belief = self.belief_of(belief, &cloud.weights)?;
        self.cloud = cloud;
        self.rng = rng;
        Ok(())
    }
}

impl<F, H, R, const N: usize, const M: usize> ParticleFilter<F, H, R, N, M>
where
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
    R: Rng + Clone,
{
    /// States of the cloud, drawn systematically: with even weights and as many as there are, each
    /// once.
    fn drawn(&self, count: usize, rng: &mut R) -> Vec<State<N>> {
        let weights = &self.cloud.weights.linear;
        let total: f64 = weights.iter().sum();
        let spacing = total / number(count);
        let mut mark = rng.random::<f64>() * spacing;
        let mut reach = 0.0;
        let mut states = Vec::with_capacity(count);
        for (i, weight) in weights.iter().enumerate() {
            reach += weight;
            while mark < reach && states.len() < count {
                states.push(self.cloud.state(i));
                mark += spacing;
            }
        }
        states
    }

    /// Draws for each later state a state that it may have come from.
    fn earlier(
        &self,
        later: &[State<N>],
        dt: f64,
        rng: &mut R,
    ) -> Result<Vec<State<N>>, EstimatorError> {
        let axes = self.motion.axes();
        let unsupported = EstimatorError::Unsupported {
            what: "smoothing a plain cloud whose motion has no noise in some component of the \
                   state",
        };
        let width = self.bandwidth_of(self.cloud.len());
        let kept = libm::sqrt(1.0 - width * width);
        let centre = self.belief.mean();
        let covariance = self.belief.estimate().covariance * (width * width);
        let mut onward = Vec::with_capacity(self.cloud.len());
        for (i, weight) in self.cloud.weights.linear.iter().enumerate() {
            let mean = centre + Axis::difference(&axes, &self.cloud.state(i), centre) * kept;
            let middle = Estimate { mean, covariance };
            let passage = Passage::of(&self.motion, &middle, dt)?;
            let root = passage.ahead(&middle).covariance.cholesky().ok_or(unsupported)?;
            let volume: f64 = root.l_dirty().diagonal().iter().map(|d| libm::log(*d)).sum();
            let white = root.l().solve_lower_triangular(&Covariance::identity());
            let white = white.ok_or(unsupported)?;
            onward.push(Onward { log: libm::log(*weight) - volume, middle: mean, passage, white });
        }
        let mut sums = Vec::with_capacity(onward.len());
        let mut logs = Vec::with_capacity(onward.len());
        let mut earlier = Vec::with_capacity(later.len());
        for state in later {
            let log = |onward: &Onward<N>| {
                let off = onward.white * Axis::difference(&axes, state, &onward.passage.mean);
                onward.log - 0.5 * off.norm_squared()
            };
            logs.clear();
            logs.extend(onward.iter().map(log));
            let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let mut reach = 0.0;
            sums.clear();
            sums.extend(logs.iter().map(|log| elementary::exp(log - best)));
            for sum in &mut sums {
                reach += *sum;
                *sum = reach;
            }
            if !(reach > 0.0 && reach.is_finite()) {
                return Err(EstimatorError::Impossible { particles: onward.len() });
            }
            let mark = rng.random::<f64>() * reach;
            let ancestor = sums.partition_point(|sum| *sum <= mark).min(sums.len() - 1);
            earlier.push(self.given(&onward[ancestor], state, &covariance, dt, rng));
        }
        Ok(earlier)
    }

    /// A state drawn from a kernel given the later state: a draw of both, and the gain's share of
    /// what the later one is off.
    fn given(
        &self,
        onward: &Onward<N>,
        later: &State<N>,
        covariance: &Covariance<N>,
        dt: f64,
        rng: &mut R,
    ) -> State<N> {
        let Onward { middle, passage, white: inverse, .. } = onward;
        let axes = self.motion.axes();
        let off = self.belief.factor() * white(rng) * self.bandwidth_of(self.cloud.len());
        let noise = self.motion.noise_factor(middle, dt) * white(rng);
        let moved = passage.mean + passage.transition * off + noise;
        let news = Axis::difference(&axes, later, &moved);
        let pull = inverse.tr_mul(&(inverse * news));
        let state = middle + off + covariance * passage.transition.tr_mul(&pull);
        Axis::difference(&axes, &state, &State::zeros())
    }
}
