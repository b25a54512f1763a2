use std::{f64::consts::TAU, sync::Arc};

use foxhunt_core::{
    Estimate, EstimatorError, MeasurementModel, MotionModel, OutlierMixture, RandomWalk, State,
    parameter::{as_value, in_range, not_negative, positive, require},
};
#[cfg(feature = "batch")]
use foxhunt_filters::{BatchEstimator, Loss};
use foxhunt_filters::{
    Ckf, Ekf, FirstBearing, Gate, GaussianSum, GridConfig, GridFilter, Imm, Iterations, Kalman,
    KldSampling, NoiseScales, ParticleFilter, Resampling, Transition, Ukf, Unscented, split,
};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};
use serde::{Deserialize, Serialize};

use crate::BoxedEstimator;

/// Motion model of any kind: filters are compiled once for each size of state.
pub type AnyMotion<const N: usize> = Arc<dyn MotionModel<N>>;

/// Measurement model of any kind.
pub type AnyModel<const N: usize, const M: usize> = Arc<dyn MeasurementModel<N, M>>;

/// Belief before the first observation, which two moments may not describe fully.
///
/// An [`Estimate`] is one: a Gaussian.
pub trait Prior<const N: usize> {
    /// Returns the first two moments of the belief.
    fn moments(&self) -> Estimate<N>;

    /// Returns true if the moments describe it fully.
    fn is_gaussian(&self) -> bool;

    /// A state drawn from it.
    fn draw(&self, rng: &mut Xoshiro256PlusPlus) -> State<N>;

    /// Gaussians side by side that make it up: `parts` along each axis.
    ///
    /// # Errors
    ///
    /// [`EstimatorError`] when there are too many parts or none.
    fn sum(&self, parts: usize) -> Result<Vec<(f64, Estimate<N>)>, EstimatorError>;

    /// Gaussians in a row whose ranges from the receiver are in geometric progression, where it is
    /// about a range: then the first bearing is part of it.
    ///
    /// # Errors
    ///
    /// [`EstimatorError`] when there are too many parts or none.
    fn row(&self, parts: usize) -> Result<Option<Vec<(f64, Estimate<N>)>>, EstimatorError>;
}

impl<const N: usize> Prior<N> for Estimate<N> {
    fn moments(&self) -> Estimate<N> {
        *self
    }

    fn is_gaussian(&self) -> bool {
        true
    }

    fn draw(&self, rng: &mut Xoshiro256PlusPlus) -> State<N> {
        use rand::RngExt;
        let normal = State::from_fn(|_, _| rng.sample(rand_distr::StandardNormal));
        let factor = self.covariance.cholesky().map(|factor| factor.unpack());
        factor.map_or(self.mean, |factor| self.mean + factor * normal)
    }

    fn sum(&self, parts: usize) -> Result<Vec<(f64, Estimate<N>)>, EstimatorError> {
        Ok(split(self, [parts, parts])?.into_iter().collect())
    }

    fn row(&self, _: usize) -> Result<Option<Vec<(f64, Estimate<N>)>>, EstimatorError> {
        Ok(None)
    }
}

/// A filter chosen at run time, over any motion and measurement model.
///
/// `iterations` is how often, at most, an update of the Kalman family is linearised; 1 unless
/// given.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum FilterConfig {
    /// The extended Kalman filter.
    Ekf {
        /// Gate against outliers.
        gate: GateConfig,
        /// Maximum number of linearisations of an update, each about its own posterior.
        #[serde(default = "once")]
        iterations: u32,
    },
    /// The cubature Kalman filter.
    Cubature {
        /// Gate against outliers.
        gate: GateConfig,
        /// Outliers; none where absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        outliers: Option<OutlierConfig>,
        /// Maximum number of linearisations of an update, each about its own posterior.
        #[serde(default = "once")]
        iterations: u32,
    },
    /// The unscented Kalman filter.
    Ukf {
        /// Gate against outliers.
        gate: GateConfig,
        /// α: how far the sigma points lie from the mean.
        alpha: f64,
        /// β: what is known of the distribution; 2 for a Gaussian.
        beta: f64,
        /// κ: the secondary scaling.
        kappa: f64,
        /// Maximum number of linearisations of an update, each about its own posterior.
        #[serde(default = "once")]
        iterations: u32,
    },
    /// A sum of Gaussians, each run by a cubature filter.
    GaussianSum {
        /// Number of Gaussians along each axis of the prior.
        parts: usize,
        /// Outliers; none where absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        outliers: Option<OutlierConfig>,
        /// Maximum number of linearisations of an update, each about its own posterior.
        #[serde(default = "once")]
        iterations: u32,
    },
    /// Two extended Kalman filters, each from one half of the prior, weighed by their evidence.
    DualEkf {
        /// Maximum number of linearisations of an update, each about its own posterior.
        #[serde(default = "once")]
        iterations: u32,
    },
    /// A bank of cubature filters in a row along the first bearing.
    RangeParameterised {
        /// Number of filters.
        parts: usize,
        /// Maximum number of linearisations of an update, each about its own posterior.
        #[serde(default = "once")]
        iterations: u32,
    },
    /// Interacting multiple models: the motion that is given, and standing still.
    Imm {
        /// Mean durations in seconds for which the target stays still, and for which it moves.
        sojourn_s: [f64; 2],
        /// The random walk of a still target, in metres per √second.
        still_drift: f64,
        /// Maximum number of linearisations of an update, each about its own posterior.
        #[serde(default = "once")]
        iterations: u32,
    },
    /// The most probable place, solved over all observations so far after each of them.
    #[cfg(feature = "batch")]
    Batch {
        /// Cost of a residual.
        loss: Loss,
    },
    /// Recursive Bayes over the cells of an area.
    Grid {
        /// Cells along each side; twice as many where the belief needs them.
        side: usize,
        /// Spread of σ of a measurement's first component, the level, about its stated value: the
        /// standard deviation of its logarithm. Exact where absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        level_noise_spread: Option<f64>,
    },
    /// The particle filter: bootstrap proposals, regularised resampling.
    Particle(ParticleConfig),
    /// A cloud of places, each with a Gaussian of the reference power, which has to be unknown.
    RaoBlackwellised {
        /// Number of particles.
        count: usize,
    },
}

/// Settings of a particle filter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParticleConfig {
    /// Number of particles; the maximum where the number adapts.
    pub count: usize,
    /// Side of the bins, in the state's units: the number of particles follows from how many bins
    /// the belief occupies. Fixed where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adaptive_bin: Option<f64>,
    /// True if particles are resampled at every step, multinomially, and not spread (Gordon,
    /// Salmond & Smith 1993), instead of when few of them count.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub every_step: bool,
}

impl ParticleConfig {
    /// A fixed number of particles, resampled when few of them count.
    #[must_use]
    pub const fn of(count: usize) -> Self {
        Self { count, adaptive_bin: None, every_step: false }
    }
}

/// The default of `iterations`.
const fn once() -> u32 {
    1
}

/// Outliers: observations evenly spread over all that there may be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutlierConfig {
    /// Share of the outliers, in [0, 1).
    pub share: f64,
    /// The volume that they are spread over: for level and bearing in dB rad.
    pub support: f64,
}

impl OutlierConfig {
    /// The mixture of an observation of M components, the volume spread evenly over them.
    fn build<const M: usize>(self) -> Result<OutlierMixture<M>, EstimatorError> {
        let Self { share, support } = self;
        positive("the support of outliers", support)?;
        let widths = match M {
            2 => std::array::from_fn(|i| if i == 0 { support / TAU } else { TAU }),
            _ => [libm::pow(support, 1.0 / as_value(M)); M],
        };
        Ok(OutlierMixture::new(share, widths)?)
    }
}

/// Gate against outliers, chosen at run time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum GateConfig {
    /// No gate.
    Open,
    /// A gate that lets in this share of what a consistent filter sees.
    Probability(f64),
    /// The reference's rule with its two exceptions (Pritzl 2018, §4.4).
    Pritzl2018,
}

impl GateConfig {
    fn build(self) -> Result<Gate, EstimatorError> {
        match self {
            Self::Open => Ok(Gate::open()),
            Self::Probability(probability) => Gate::probability(probability),
            Self::Pritzl2018 => Ok(Gate::pritzl2018()),
        }
    }
}

/// A filter over states of N and measurements of M components.
///
/// It is implemented for the sizes of hunts and trials, each compiled here and nowhere else.
pub trait FilterOf<const N: usize, const M: usize> {
    /// Builds the filter over two models and a prior; `seed` is for filters that draw random
    /// numbers.
    ///
    /// # Errors
    ///
    /// [`EstimatorError`] when the prior or a parameter does not make one.
    fn build(
        &self,
        motion: AnyMotion<N>,
        model: AnyModel<N, M>,
        prior: &dyn Prior<N>,
        seed: u64,
    ) -> Result<BoxedEstimator<N, M>, EstimatorError>;
}

macro_rules! filters_of {
    ($(($n:literal, $m:literal) $dual:ident),+) => {$(
        impl FilterOf<$n, $m> for FilterConfig {
            fn build(
                &self,
                motion: AnyMotion<$n>,
                model: AnyModel<$n, $m>,
                prior: &dyn Prior<$n>,
                seed: u64,
            ) -> Result<BoxedEstimator<$n, $m>, EstimatorError> {
                match *self {
                    Self::DualEkf { iterations } => $dual(iterations, motion, model, prior),
                    _ => self.of_size(motion, model, prior, seed),
                }
            }
        }
    )+};
}

// A place with its level and bearing, with the reference power, and with the exponent or a
// velocity; a place, and one with its velocity, of bearings or differences alone.
filters_of!((2, 2) dual_ekf, (3, 2) no_dual, (4, 2) no_dual, (2, 1) dual_ekf, (4, 1) dual_ekf);

/// Two extended Kalman filters, from the halves of a prior along its longer axis.
fn dual_ekf<const N: usize, const M: usize>(
    iterations: u32,
    motion: AnyMotion<N>,
    model: AnyModel<N, M>,
    prior: &dyn Prior<N>,
) -> Result<BoxedEstimator<N, M>, EstimatorError> {
    let moments = prior.moments();
    let filter =
        Ekf::new(motion, model, moments)?.with_iterations(Iterations::at_most(iterations)?);
    Ok(Box::new(GaussianSum::new(&filter, split(&moments, [2, 1])?)?))
}

/// Refuses larger states: each size of a sum costs as much to build as a filter.
fn no_dual<const N: usize, const M: usize>(
    _: u32,
    _: AnyMotion<N>,
    _: AnyModel<N, M>,
    _: &dyn Prior<N>,
) -> Result<BoxedEstimator<N, M>, EstimatorError> {
    Err(EstimatorError::Unsupported {
        what: "two Kalman filters of more than a place (power_sigma_db)",
    })
}

impl FilterConfig {
    /// Builds the filter for a size that this package has.
    fn of_size<const N: usize, const M: usize>(
        &self,
        motion: AnyMotion<N>,
        model: AnyModel<N, M>,
        prior: &dyn Prior<N>,
        seed: u64,
    ) -> Result<BoxedEstimator<N, M>, EstimatorError> {
        let moments = prior.moments();
        Ok(match *self {
            Self::Ekf { gate, iterations } => Box::new(
                Ekf::new(motion, model, moments)?
                    .with_gate(gate.build()?)
                    .with_iterations(Iterations::at_most(iterations)?),
            ),
            Self::Cubature { gate, outliers, iterations } => {
                let filter = Ckf::new(motion, model, moments)?
                    .with_gate(gate.build()?)
                    .with_iterations(Iterations::at_most(iterations)?);
                match outliers {
                    Some(outliers) => Box::new(filter.with_outliers(outliers.build()?)),
                    None => Box::new(filter),
                }
            }
            Self::Ukf { gate, alpha, beta, kappa, iterations } => Box::new(
                Ukf::new(motion, model, moments)?
                    .with_transform(Unscented::new(alpha, beta, kappa)?)?
                    .with_gate(gate.build()?)
                    .with_iterations(Iterations::at_most(iterations)?),
            ),
            Self::GaussianSum { parts, outliers, iterations } => {
                let filter = Ckf::new(motion, model, moments)?
                    .with_iterations(Iterations::at_most(iterations)?);
                let sum = GaussianSum::new(&filter, prior.sum(parts)?)?;
                match outliers {
                    Some(outliers) => Box::new(sum.with_outliers(outliers.build()?)),
                    None => Box::new(sum),
                }
            }
            Self::RangeParameterised { parts, iterations } => {
                let filter = Ckf::new(motion, model, moments)?
                    .with_iterations(Iterations::at_most(iterations)?);
                match prior.row(parts)? {
                    Some(row) => Box::new(GaussianSum::new(&filter, row)?),
                    None => Box::new(FirstBearing::new(filter, parts)?),
                }
            }
            Self::Imm { sojourn_s, still_drift, iterations } => {
                let still: AnyMotion<N> = Arc::new(still_walk(still_drift, &moments)?);
                let iterations = Iterations::at_most(iterations)?;
                let modes = [still, motion]
                    .into_iter()
                    .map(|motion| {
                        let filter = Ckf::new(motion, Arc::clone(&model), moments)?;
                        Ok((0.5, filter.with_iterations(iterations)))
                    })
                    .collect::<Result<Vec<_>, EstimatorError>>()?;
                let imm = Imm::new(modes, Transition::sojourn(&sojourn_s)?)?;
                Box::new(imm.with_innovation(Kalman::innovation))
            }
            #[cfg(feature = "batch")]
            Self::Batch { loss } => {
                let batch = BatchEstimator::new(as_walk(&motion, &moments)?, model, moments)?;
                Box::new(batch.with_loss(loss)?)
            }
            Self::Grid { side, level_noise_spread } => {
                let config = grid_config(side, level_noise_spread)?;
                Box::new(GridFilter::new(motion, model, moments, config)?)
            }
            Self::Particle(ParticleConfig { count, adaptive_bin, every_step }) => {
                let mut rng = generator(count, seed)?;
                let cloud = if prior.is_gaussian() {
                    ParticleFilter::new(motion, model, moments, count, rng)?
                } else {
                    let states: Vec<_> = (0..count).map(|_| prior.draw(&mut rng)).collect();
                    ParticleFilter::from_samples(motion, model, &states, rng)?
                };
                let cloud = match every_step {
                    true => cloud
                        .with_resampling(Resampling::Multinomial)
                        .with_resampling_threshold(1.0)?
                        .with_kernel_bandwidth(0.0)?
                        .with_progressive_correction(0.0)?,
                    false => cloud,
                };
                match adaptive_bin {
                    Some(bin) => {
                        let size = KldSampling::new(State::repeat(bin), FEWEST.min(count), count)?;
                        Box::new(cloud.with_adaptive_size(size))
                    }
                    None => Box::new(cloud),
                }
            }
            Self::DualEkf { .. } => {
                return no_dual(1, motion, model, prior);
            }
            Self::RaoBlackwellised { .. } => {
                return Err(EstimatorError::Unsupported {
                    what: "a Rao-Blackwellised cloud without a reference power in its state",
                });
            }
        })
    }

    /// A grid as [`build`](Self::build) makes it, but for a model with cliffs; `None` for any other
    /// filter.
    pub(crate) fn grid_with_cliffs(&self) -> Result<Option<GridConfig>, EstimatorError> {
        let Self::Grid { side, level_noise_spread } = *self else { return Ok(None) };
        Ok(Some(GridConfig { cliffs: true, ..grid_config(side, level_noise_spread)? }))
    }

    /// Sets the gate, where the filter has one.
    #[must_use]
    pub fn with_gate(mut self, other: GateConfig) -> Self {
        if let Self::Ekf { gate, .. } | Self::Cubature { gate, .. } | Self::Ukf { gate, .. } =
            &mut self
        {
            *gate = other;
        }
        self
    }

    /// Sets the number of particles, where the filter has particles.
    #[must_use]
    pub fn with_particles(mut self, particles: usize) -> Self {
        if let Self::Particle(ParticleConfig { count, .. }) | Self::RaoBlackwellised { count } =
            &mut self
        {
            *count = particles;
        }
        self
    }

    /// The filter with a share of outliers, where it is a Gaussian sum, which needs to know it.
    #[must_use]
    pub fn with_outliers_of_sum(mut self, share: OutlierConfig) -> Self {
        if let Self::GaussianSum { outliers, .. } = &mut self {
            *outliers = Some(share);
        }
        self
    }
}

/// A target at rest: its place drifts, and what else is in its state goes on as it may, a velocity
/// that it does not use among it.
fn still_walk<const N: usize>(
    drift: f64,
    prior: &Estimate<N>,
) -> Result<RandomWalk<N>, EstimatorError> {
    not_negative("still_drift", drift)?;
    // Within ten seconds it may be anything again that it was before the first observation.
    let rest = |row: usize| (prior.covariance[(row, row)] / 10.0).sqrt();
    Ok(RandomWalk { drift: State::from_fn(|row, _| if row < 2 { drift } else { rest(row) }) })
}

/// A motion that is a random walk, as one.
#[cfg(feature = "batch")]
fn as_walk<const N: usize>(
    motion: &AnyMotion<N>,
    prior: &Estimate<N>,
) -> Result<RandomWalk<N>, EstimatorError> {
    let noise = motion.noise_factor(&prior.mean, 1.0);
    let drift = noise.diagonal();
    let moved = (motion.propagate(&prior.mean, 1.0) - prior.mean).norm()
        + (noise - nalgebra::SMatrix::from_diagonal(&drift)).norm();
    let name = "what the target moves in a second";
    require(moved <= 1e-9, name, moved, "0: a batch is of one place")?;
    Ok(RandomWalk { drift })
}

/// The cells of a grid.
pub(crate) fn grid_config(side: usize, spread: Option<f64>) -> Result<GridConfig, EstimatorError> {
    let noise_scales = spread.map(noise_scales).transpose()?;
    Ok(GridConfig { side, most_per_side: 2 * side, noise_scales, ..GridConfig::default() })
}

/// A log-normal distribution of the factor on a level's σ, at five nodes three quarters of a
/// deviation apart in its logarithm.
fn noise_scales(spread: f64) -> Result<NoiseScales, EstimatorError> {
    require(spread > 0.0 && spread <= 3.0, "level_noise_spread", spread, "in (0, 3]")?;
    let node = |deviations: f64| {
        (libm::exp(spread * deviations), libm::exp(-0.5 * deviations * deviations))
    };
    Ok(NoiseScales { component: 0, factors: [-1.5, -0.75, 0.0, 0.75, 1.5].map(node).to_vec() })
}

/// The largest cloud that a file may set.
const MOST_PARTICLES: usize = 10_000_000;

/// The smallest cloud whose size adapts.
const FEWEST: usize = 500;

/// The generator of a cloud of `count` particles.
///
/// # Errors
///
/// [`EstimatorError::Parameter`] when there are too many: a number from a file must not be able to
/// take all memory there is.
pub(crate) fn generator(count: usize, seed: u64) -> Result<Xoshiro256PlusPlus, EstimatorError> {
    in_range("count", as_value(count), 0.0..=as_value(MOST_PARTICLES), "at most 10 000 000")?;
    Ok(Xoshiro256PlusPlus::seed_from_u64(seed))
}
