//! Particles over some components of the state, with a Kalman filter in each for the others.

use alloc::{vec, vec::Vec};

use foxhunt_core::{
    Axis, Correction, Covariance, Estimate, Estimator, EstimatorError, MeasurementModel,
    MotionModel, Observation, Quantity, Role, Smooth, State, noise, parameter::require,
};
use nalgebra::{SMatrix, SVector};
use rand::Rng;

use super::{
    Cloud, KEPT, MOST_STAGES, Threads, Weights, check_progressive, largest_exponent,
    resampling::Resampling,
    step::moments,
    white::{Kernel, silverman, white},
};
use crate::{Gaussian, Innovation, count::number};

/// A particle filter over the first N − K components of the state, with a Kalman filter in each
/// particle for the last K (Doucet, de Freitas, Murphy & Russell 2000; Schön, Gustafsson &
/// Nordlund 2005).
///
/// The last K components have to enter the measurement linearly once the others are given, such
/// as a transmitter's reference power and path-loss exponent once its place is: their columns of
/// the model's Jacobian do not depend on them. The noise has to be Gaussian: `log_likelihood` is
/// used only for a bearing that several directions compete for. The sampled components may
/// not move with the others, nor share their noise; a motion that does is refused.
///
/// Integrating them out leaves fewer dimensions to sample, and nothing of them to freeze: a power
/// that does not drift stays a Gaussian for ever. Resampling, its kernel and progressive correction
/// are as in [`ParticleFilter`](crate::ParticleFilter); the kernel moves the conditional means
/// along with the particles, as the two go together in the cloud.
#[derive(Clone, Debug)]
pub struct RaoBlackwellised<F, H, R, const N: usize, const M: usize, const K: usize> {
    motion: F,
    measurement: H,
    rng: R,
    cloud: Conditional<N, K>,
    belief: Estimate<N>,
    resampling: Resampling,
    threshold: f64,
    progressive: f64,
}

impl<F, H, R, const N: usize, const M: usize, const K: usize> RaoBlackwellised<F, H, R, N, M, K>
where
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
    R: Rng,
{
    /// A filter of `particles` drawn from the Gaussian `prior`, in each of them what the prior
    /// has of the last K components given the others.
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
        const { assert!(K > 0 && K < N, "something has to be sampled, and something not") };
        let enough = "more than the state has components";
        require(particles > N, "particles", number(particles), enough)?;
        let prior = Gaussian::new(prior, Role::Prior)?;
        let nuisance = prior.factor().fixed_view::<K, K>(N - K, N - K);
        let spread = nuisance * nuisance.transpose();
        let mut means = Cloud {
            columns: core::array::from_fn(|_| vec![0.0; particles]),
            weights: Weights::even(particles),
        };
        for i in 0..particles {
            // L is lower triangular: without their own ξ the last components are their mean given
            // the first.
            let mut drawn: State<N> = white(&mut rng);
            (N - K..N).for_each(|row| drawn[row] = 0.0);
            means.set(i, &(prior.mean() + prior.factor() * drawn));
        }
        let cloud = Conditional { means, spreads: vec![spread; particles] };
        let belief = *prior.estimate();
        let resampling = Resampling::default();
        let threshold = 0.5;
        let progressive = 0.1;
        let made =
            Self { motion, measurement, rng, cloud, belief, resampling, threshold, progressive };
        let belief = made.belief_of(&made.cloud)?;
        Ok(Self { belief, ..made })
    }

    /// Sets the scheme for drawing ancestors.
    #[must_use]
    pub fn with_resampling(self, resampling: Resampling) -> Self {
        Self { resampling, ..self }
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

    /// 1 / Σ w²: how many particles of equal weight would be as good.
    #[must_use]
    pub fn effective_sample_size(&self) -> f64 {
        self.cloud.means.weights.effective_sample_size()
    }

    /// The moments of the mixture, and what a cloud of its effective size misses, as
    /// [`ParticleFilter`](crate::ParticleFilter) adds it, of the sampled components.
    fn belief_of(&self, cloud: &Conditional<N, K>) -> Result<Estimate<N>, EstimatorError> {
        let weights = &cloud.means.weights;
        let mut belief =
            moments(&cloud.means.columns, &weights.linear, &self.motion.axes(), Threads::One);
        let within = weights
            .linear
            .iter()
            .zip(&cloud.spreads)
            .fold(Covariance::<K>::zeros(), |sum, (weight, spread)| sum + spread * *weight);
        let mut block = belief.covariance.fixed_view_mut::<K, K>(N - K, N - K);
        block += within;
        let count = number(cloud.len());
        let cell = libm::pow(count, -2.0 / number(N - K));
        let missed = cell * libm::fmax(1.0 / weights.effective_sample_size() - 1.0 / count, 1e-6);
        belief.covariance += self.belief.covariance * missed;
        Gaussian::new(belief, Role::Posterior).map(|belief| *belief.estimate())
    }

    /// The next generation, resampled if that is due, and moved.
    fn moved(&mut self, dt: f64) -> Result<Conditional<N, K>, EstimatorError> {
        let due = self.effective_sample_size() < self.threshold * number(self.cloud.len());
        let axes = self.motion.axes();
        let mut next = if due {
            self.cloud.regularised(&axes, self.resampling, &mut self.rng)
        } else {
            self.cloud.clone()
        };
        for i in 0..next.len() {
            let moved = next.particle(i).moved(&self.motion, dt, white(&mut self.rng))?;
            next.set(i, &moved, &axes);
        }
        Ok(next)
    }

    /// The posterior cloud and the log-evidence; in stages where the cloud would starve.
    fn corrected(
        &mut self,
        observation: &Observation<M>,
    ) -> Result<(Conditional<N, K>, f64), EstimatorError> {
        let linear = self.linearised(&self.cloud, observation);
        let at_once = Tempered::new(observation, 1.0)?;
        let (mut cloud, evidence) = self.stage(&self.cloud, &linear, &at_once)?;
        let wanted = self.progressive * number(cloud.len());
        if cloud.means.weights.effective_sample_size() >= wanted {
            return Ok((cloud, evidence));
        }
        cloud = self.cloud.clone();
        let mut weights = cloud.means.weights.clone();
        let mut left = 1.0;
        let mut log_evidence = 0.0;
        for stage in 1..=MOST_STAGES {
            if cloud.means.weights.effective_sample_size() < KEPT * number(cloud.len()) {
                let axes = self.motion.axes();
                cloud = cloud.regularised(&axes, self.resampling, &mut self.rng);
            }
            let linear = self.linearised(&cloud, observation);
            let prior = &cloud.means.weights;
            let size = |exponent| {
                let size = Tempered::new(observation, exponent).and_then(|noise| {
                    log_densities(&linear, &noise, &mut weights);
                    weights.condition(prior, Threads::One)
                });
                size.map_or(f64::NAN, |_| weights.effective_sample_size())
            };
            let wanted = KEPT * prior.effective_sample_size();
            let exponent =
                if stage == MOST_STAGES { left } else { largest_exponent(left, wanted, size) };
            let evidence;
            (cloud, evidence) =
                self.stage(&cloud, &linear, &Tempered::new(observation, exponent)?)?;
            log_evidence += evidence;
            left -= exponent;
            if left <= 0.0 {
                break;
            }
        }
        Ok((cloud, log_evidence))
    }

    fn linearised(
        &self,
        cloud: &Conditional<N, K>,
        observation: &Observation<M>,
    ) -> Vec<Linearised<M, K>> {
        let bearing = observation.competing_bearing();
        let linear =
            |i| cloud.particle(i).linearised(&self.measurement, observation, bearing.as_ref());
        (0..cloud.len()).map(linear).collect()
    }

    /// The cloud conditioned on p(z | x)^φ.
    fn stage(
        &self,
        from: &Conditional<N, K>,
        linear: &[Linearised<M, K>],
        noise: &Tempered<M>,
    ) -> Result<(Conditional<N, K>, f64), EstimatorError> {
        let mut next = from.clone();
        let axes = self.motion.axes();
        log_densities(linear, noise, &mut next.means.weights);
        let log_evidence = next.means.weights.condition(&from.means.weights, Threads::One)?;
        for (i, linear) in linear.iter().enumerate() {
            let corrected = from.particle(i).corrected(linear, noise);
            let role = Role::Innovation;
            let corrected = corrected.ok_or(EstimatorError::NotPositiveDefinite { role })?;
            next.set(i, &corrected, &axes);
        }
        Ok((next, log_evidence))
    }
}

/// Refused: a smoother would have to draw the Gaussians' states too.
impl<F, H, R, const N: usize, const M: usize, const K: usize> Smooth<N, M>
    for RaoBlackwellised<F, H, R, N, M, K>
where
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
    R: Rng + Clone,
{
    fn smooth(&mut self, _: &Self, _: f64) -> Result<(), EstimatorError> {
        Err(EstimatorError::Unsupported { what: "smoothing a Rao-Blackwellised cloud" })
    }
}

impl<F, H, R, const N: usize, const M: usize, const K: usize> Estimator<N, M>
    for RaoBlackwellised<F, H, R, N, M, K>
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
        let cloud = self.moved(dt)?;
        self.belief = self.belief_of(&cloud)?;
        self.cloud = cloud;
        Ok(())
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        if observation.is_empty() {
            return Ok(Correction::Empty);
        }
        let nis = Innovation::of_belief(&*self, &self.measurement, observation);
        let (cloud, log_evidence) = self.corrected(observation)?;
        self.belief = self.belief_of(&cloud)?;
        self.cloud = cloud;
        Ok(Correction::Fused {
            nis: nis.map(|innovation| innovation.nis),
            log_evidence,
            effective_sample_size: Some(self.effective_sample_size()),
        })
    }

    fn estimate(&self) -> Estimate<N> {
        self.belief
    }

    fn quantities(&self) -> [Quantity; M] {
        self.measurement.quantities()
    }

    /// Each particle with the 2 K cubature points of what is not sampled.
    fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        for (i, weight) in self.cloud.means.weights.linear.iter().enumerate() {
            let particle = self.cloud.particle(i);
            let Some(factor) = particle.spread.cholesky() else {
                visit(&particle.state, *weight);
                continue;
            };
            let spread = factor.unpack() * libm::sqrt(number(K));
            for column in spread.column_iter() {
                for sign in [1.0, -1.0] {
                    let mut state = particle.state;
                    (0..K).for_each(|row| state[N - K + row] += sign * column[row]);
                    visit(&state, 0.5 * weight / number(K));
                }
            }
        }
    }
}

/// Particles whose last K columns are conditional means, and their conditional covariances.
#[derive(Clone, Debug)]
struct Conditional<const N: usize, const K: usize> {
    means: Cloud<N>,
    spreads: Vec<Covariance<K>>,
}

impl<const N: usize, const K: usize> Conditional<N, K> {
    fn len(&self) -> usize {
        self.spreads.len()
    }

    fn particle(&self, i: usize) -> Particle<N, K> {
        Particle { state: self.means.state(i), spread: self.spreads[i] }
    }

    fn set(&mut self, i: usize, particle: &Particle<N, K>, axes: &[Axis; N]) {
        self.means.set(i, &Axis::difference(axes, &particle.state, &State::zeros()));
        self.spreads[i] = particle.spread;
    }

    /// The cloud resampled, its copies set apart.
    fn regularised(&self, axes: &[Axis; N], resampling: Resampling, rng: &mut impl Rng) -> Self {
        let mut ancestors = vec![0; self.len()];
        let mut scratch = Weights::even(self.len());
        let weights = &self.means.weights.linear;
        resampling.draw(weights, rng, scratch.scratch(), &mut ancestors, Threads::One);
        let between = moments(&self.means.columns, weights, axes, Threads::One);
        let factor = semidefinite_factor(&between.covariance);
        let bandwidth = silverman(N - K, self.len());
        let kernel = Kernel::new(&between.mean, &factor, bandwidth, *axes);
        let mut next = self.clone();
        for (i, ancestor) in ancestors.into_iter().enumerate() {
            let Particle { state, spread } = self.particle(ancestor as usize);
            let state = kernel.as_ref().map_or(state, |kernel| kernel.draw(&state, rng));
            next.set(i, &Particle { state, spread }, axes);
        }
        next.means.weights.fill_even(Threads::One);
        next
    }
}

/// The last K components of one particle, given the others: a Gaussian whose mean stands in the
/// particle's state.
#[derive(Clone, Copy, Debug)]
struct Particle<const N: usize, const K: usize> {
    state: State<N>,
    spread: Covariance<K>,
}

impl<const N: usize, const K: usize> Particle<N, K> {
    /// The first of the components that are integrated out.
    const FIRST: usize = N - K;

    /// Linearises an observation about this particle; `bearing` is its
    /// [`competing_bearing`](Observation::competing_bearing).
    fn linearised<const M: usize>(
        &self,
        model: &impl MeasurementModel<N, M>,
        observation: &Observation<M>,
        bearing: Option<&(usize, [Observation<M>; 2])>,
    ) -> Linearised<M, K> {
        let jacobian = model.jacobian(&self.state, observation.receiver());
        let slope = jacobian.fixed_columns::<K>(Self::FIRST).into_owned();
        let slope = observation.strike(slope);
        let expected = model.expected(&self.state, observation.receiver());
        let residual = model.residual(observation.value(), &expected);
        let residual = observation.strike(residual);
        let spread = slope * self.spread * slope.transpose();
        let competing = match bearing {
            Some((row, alone)) if slope.row(*row).norm_squared() <= 0.0 => {
                let [mixture, moments] =
                    alone.each_ref().map(|one| model.log_likelihood(&self.state, one));
                mixture - moments
            }
            _ => 0.0,
        };
        Linearised { slope, residual, spread, dof: observation.len(), competing }
    }

    /// The Kalman filter of the nuisance, in Joseph's form.
    fn corrected<const M: usize>(
        &self,
        linear: &Linearised<M, K>,
        noise: &Tempered<M>,
    ) -> Option<Self> {
        // Gᵀ = S⁻¹ H P.
        let cross = linear.slope * self.spread;
        let factor = linear.factor(noise)?;
        let white = factor.solve_lower_triangular(&cross)?;
        let gain = factor.tr_solve_lower_triangular(&white)?.transpose();
        let kept = Covariance::<K>::identity() - gain * linear.slope;
        let mut spread =
            kept * self.spread * kept.transpose() + gain * noise.noise * gain.transpose();
        spread.fill_upper_triangle_with_lower_triangle();
        let step = gain * linear.residual;
        let mut state = self.state;
        (0..K).for_each(|i| state[Self::FIRST + i] += step[i]);
        Some(Self { state, spread })
    }

    /// The particle `dt` seconds on; `white` moves what is sampled.
    ///
    /// # Errors
    ///
    /// An error when what is sampled moves with the nuisance or shares its noise: it would depend
    /// on it.
    fn moved(
        &self,
        motion: &impl MotionModel<N>,
        dt: f64,
        white: State<N>,
    ) -> Result<Self, EstimatorError> {
        let factor = motion.noise_factor(&self.state, dt);
        let noise = factor * factor.transpose();
        let jacobian = motion.jacobian(&self.state, dt);
        let shared = |i: usize, j: usize| {
            let scale = libm::sqrt(noise[(i, i)] * noise[(j, j)]);
            jacobian[(i, j)].abs().max(if scale > 0.0 { noise[(i, j)].abs() / scale } else { 0.0 })
        };
        let coupling = (0..Self::FIRST)
            .flat_map(|i| (Self::FIRST..N).map(move |j| (i, j)))
            .fold(0.0, |most: f64, (i, j)| most.max(shared(i, j)));
        // A numerical Jacobian is not exactly zero.
        require(
            coupling <= 1e-6,
            "coupling of the sampled components to the others",
            coupling,
            "none",
        )?;
        let mut state = motion.propagate(&self.state, dt);
        let step = factor * white;
        (0..Self::FIRST).for_each(|i| state[i] += step[i]);
        let turn = jacobian.fixed_view::<K, K>(Self::FIRST, Self::FIRST).into_owned();
        let noise = noise.fixed_view::<K, K>(Self::FIRST, Self::FIRST).into_owned();
        let mut spread = turn * self.spread * turn.transpose() + noise;
        spread.fill_upper_triangle_with_lower_triangle();
        Ok(Self { state, spread })
    }
}

/// An observation linearised about one particle, the nuisance integrated out.
#[derive(Clone, Copy, Debug)]
struct Linearised<const M: usize, const K: usize> {
    /// ∂h over the last K components; missing rows are zero.
    slope: SMatrix<f64, M, K>,
    residual: SVector<f64, M>,
    /// Addition of the nuisance to the noise.
    spread: Covariance<M>,
    dof: usize,
    /// Change of the log-likelihood by directions that compete for the bearing.
    competing: f64,
}

impl<const M: usize, const K: usize> Linearised<M, K> {
    /// H with H Hᵀ = S.
    fn factor(&self, noise: &Tempered<M>) -> Option<SMatrix<f64, M, M>> {
        Some((self.spread + noise.noise).cholesky()?.unpack())
    }

    /// ln p(z | what is sampled)^φ; NaN where the model gives none.
    fn log_density(&self, noise: &Tempered<M>) -> f64 {
        let density = |factor| noise::gaussian(&self.residual, &factor, self.dof);
        let constant = noise.log_constant + noise.exponent * self.competing;
        self.factor(noise).map_or(f64::NAN, |factor| density(factor) + constant)
    }
}

/// The noise of an observation that is applied with an exponent: N(r; 0, R)^φ is N(r; 0, R/φ) but
/// for a constant.
struct Tempered<const M: usize> {
    noise: Covariance<M>,
    exponent: f64,
    /// The logarithm of that constant.
    log_constant: f64,
}

impl<const M: usize> Tempered<M> {
    fn new(observation: &Observation<M>, exponent: f64) -> Result<Self, EstimatorError> {
        let whole = observation.noise();
        let noise = Covariance::from_fn(|i, j| {
            let present = observation.has(i) && observation.has(j);
            if present { whole[(i, j)] / exponent } else { whole[(i, j)] }
        });
        let factor = |noise: Covariance<M>| {
            let role = Role::Innovation;
            noise
                .cholesky()
                .map(|factor| factor.unpack())
                .ok_or(EstimatorError::NotPositiveDefinite { role })
        };
        let none = SVector::zeros();
        let dof = observation.len();
        let whole = noise::gaussian(&none, &factor(whole)?, dof);
        let log_constant = exponent * whole - noise::gaussian(&none, &factor(noise)?, dof);
        Ok(Self { noise, exponent, log_constant })
    }
}

fn log_densities<const M: usize, const K: usize>(
    linear: &[Linearised<M, K>],
    noise: &Tempered<M>,
    weights: &mut Weights,
) {
    for (log, linear) in weights.log.iter_mut().zip(linear) {
        *log = linear.log_density(noise);
    }
}

/// The lower triangular L with L Lᵀ = P, for a P that may be singular: conditional means that
/// are one function of the particles' places make it so.
fn semidefinite_factor<const N: usize>(covariance: &Covariance<N>) -> SMatrix<f64, N, N> {
    let mut rest = *covariance;
    let mut factor = SMatrix::<f64, N, N>::zeros();
    for k in 0..N {
        // What is left of a variance by rounding alone has no direction.
        if rest[(k, k)] <= 1e-12 * covariance[(k, k)] {
            continue;
        }
        let mut column = rest.column(k) / libm::sqrt(rest[(k, k)]);
        (0..k).for_each(|row| column[row] = 0.0);
        rest -= column * column.transpose();
        factor.set_column(k, &column);
    }
    factor
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;

    use super::*;

    #[test]
    fn a_singular_covariance_has_a_factor() {
        // The third component is the sum of the first two; the second alone has no spread.
        let map = Matrix3::new(2.0, 0.0, 0.0, 0.5, 1.0, 0.0, 2.5, 1.0, 0.0);
        let singular = map * map.transpose();
        let factor = semidefinite_factor(&singular);
        assert!((factor * factor.transpose() - singular).norm() < 1e-12);
        assert!((factor - factor.lower_triangle()).norm() <= 0.0);
        let regular = singular + Matrix3::identity();
        let exact = regular.cholesky().expect("definite").unpack();
        assert!((semidefinite_factor(&regular) - exact).norm() < 1e-12);
        assert!(semidefinite_factor(&Matrix3::zeros()).norm() <= 0.0);
    }
}
