use std::sync::Arc;

use foxhunt_core::{
    BeaconId, Estimate, EstimatorError, MeasurementModel, MotionModel, RandomWalk, State,
    noise::OutlierMixture,
};
use foxhunt_filters::{
    BatchEstimator, Ckf, Ekf, FirstBearing, Gate, GaussianSum, GridConfig, GridFilter, Imm,
    Iterations, Kalman, KldSampling, Loss, NoiseScales, ParticleFilter, Transition, Ukf, Unscented,
    split,
};
use nalgebra::SMatrix;
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};
use serde::{Deserialize, Serialize};

use super::BoxedEstimator;

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
        /// What keeps outliers out.
        gate: GateConfig,
        /// How often an update is linearised, each time about its own posterior.
        #[serde(default = "once")]
        iterations: u32,
    },
    /// The cubature Kalman filter.
    Cubature {
        /// What keeps outliers out.
        gate: GateConfig,
        /// Observations that say nothing; none where absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        outliers: Option<OutlierConfig>,
        /// How often an update is linearised, each time about its own posterior.
        #[serde(default = "once")]
        iterations: u32,
    },
    /// The unscented Kalman filter.
    Ukf {
        /// What keeps outliers out.
        gate: GateConfig,
        /// α: how far the sigma points lie from the mean.
        alpha: f64,
        /// β: what is known of the distribution; 2 for a Gaussian.
        beta: f64,
        /// κ: the secondary scaling.
        kappa: f64,
        /// How often an update is linearised, each time about its own posterior.
        #[serde(default = "once")]
        iterations: u32,
    },
    /// A sum of Gaussians, each run by a cubature filter.
    GaussianSum {
        /// How many there are along each axis of the prior.
        parts: usize,
        /// How often an update is linearised, each time about its own posterior.
        #[serde(default = "once")]
        iterations: u32,
    },
    /// A bank of cubature filters in a row along the first bearing.
    RangeParameterised {
        /// How many there are.
        parts: usize,
        /// How often an update is linearised, each time about its own posterior.
        #[serde(default = "once")]
        iterations: u32,
    },
    /// Interacting multiple models: the motion that is given, and standing still.
    Imm {
        /// How long the target stays still, and how long it moves, on average in seconds.
        sojourn_s: [f64; 2],
        /// The random walk of a still target, in metres per √second.
        still_drift: f64,
        /// How often an update is linearised, each time about its own posterior.
        #[serde(default = "once")]
        iterations: u32,
    },
    /// The most probable place, solved anew over all observations after each.
    Batch {
        /// What a residual costs.
        loss: Loss,
    },
    /// Recursive Bayes over the cells of an area.
    Grid {
        /// Cells along each side; twice as many where the belief asks for it.
        side: usize,
        /// How far σ of a measurement's first component, the level, may be from what is said of
        /// it: the standard deviation of its logarithm. Exact where absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        level_noise_spread: Option<f64>,
    },
    /// The particle filter: bootstrap proposals, regularised resampling.
    Particle {
        /// How many particles, at the most where their number adapts.
        count: usize,
        /// How many there are follows from the bins of this side, in the state's units, that the
        /// belief occupies; fixed where absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        adaptive_bin: Option<f64>,
    },
    /// A cloud of places, each with a Gaussian of the reference power, which has to be unknown.
    RaoBlackwellised {
        /// How many particles.
        count: usize,
    },
}

/// The default of `iterations`.
const fn once() -> u32 {
    1
}

/// Observations that say nothing: evenly spread over all that there may be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutlierConfig {
    /// Their share, in [0, 1).
    pub share: f64,
    /// The volume that they are spread over: for level and bearing in dB rad.
    pub support: f64,
}

impl OutlierConfig {
    fn build(self) -> Result<OutlierMixture, EstimatorError> {
        let Self { share: value, support } = self;
        let (name, requirement) = ("the share of outliers", "in [0, 1), their support positive");
        let none = EstimatorError::Parameter { name, value, requirement };
        OutlierMixture::new(value, support).ok_or(none)
    }
}

/// What keeps outliers out, chosen at run time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum GateConfig {
    /// Nothing.
    Open,
    /// A gate that lets in this share of what a consistent filter sees.
    Probability(f64),
    /// The reference's rule with its two exceptions (Pritzl 2018, §4.4).
    Pritzl2018,
}

impl GateConfig {
    pub(crate) fn build(self) -> Result<Gate, EstimatorError> {
        match self {
            Self::Open => Ok(Gate::open()),
            Self::Probability(probability) => Gate::probability(probability),
            Self::Pritzl2018 => Ok(Gate::pritzl2018()),
        }
    }
}

impl FilterConfig {
    /// Builds the filter over two models and a prior; `seed` is for those that draw random
    /// numbers.
    ///
    /// # Errors
    ///
    /// [`EstimatorError`] when the prior or a parameter does not make one.
    pub fn build<F, H, const N: usize, const M: usize>(
        &self,
        motion: F,
        model: H,
        prior: &Estimate<N>,
        seed: u64,
    ) -> Result<BoxedEstimator<N, M>, EstimatorError>
    where
        F: MotionModel<N> + Clone + 'static,
        H: MeasurementModel<N, M> + Clone + 'static,
    {
        Ok(match *self {
            Self::Ekf { gate, iterations } => Box::new(
                Ekf::new(motion, model, *prior)?
                    .with_gate(gate.build()?)
                    .with_iterations(Iterations::at_most(iterations)?),
            ),
            Self::Cubature { gate, outliers, iterations } => {
                let filter = Ckf::new(motion, model, *prior)?
                    .with_gate(gate.build()?)
                    .with_iterations(Iterations::at_most(iterations)?);
                match outliers {
                    Some(outliers) => Box::new(filter.with_outliers(outliers.build()?)),
                    None => Box::new(filter),
                }
            }
            Self::Ukf { gate, alpha, beta, kappa, iterations } => Box::new(
                Ukf::new(motion, model, *prior)?
                    .with_transform(Unscented::new(alpha, beta, kappa)?)?
                    .with_gate(gate.build()?)
                    .with_iterations(Iterations::at_most(iterations)?),
            ),
            Self::GaussianSum { parts, iterations } => {
                let filter = Ckf::new(motion, model, *prior)?
                    .with_iterations(Iterations::at_most(iterations)?);
                Box::new(GaussianSum::new(&filter, split(prior, [parts, parts])?)?)
            }
            Self::RangeParameterised { parts, iterations } => {
                let filter = Ckf::new(motion, model, *prior)?
                    .with_iterations(Iterations::at_most(iterations)?);
                Box::new(FirstBearing::new(filter, parts)?)
            }
            Self::Imm { sojourn_s, still_drift, iterations } => {
                let still = still_walk(still_drift, prior)?;
                let motions: [Arc<dyn MotionModel<N>>; 2] = [Arc::new(still), Arc::new(motion)];
                let iterations = Iterations::at_most(iterations)?;
                let modes = motions
                    .into_iter()
                    .map(|motion| {
                        let filter = Ckf::new(motion, model.clone(), *prior)?;
                        Ok((0.5, filter.with_iterations(iterations)))
                    })
                    .collect::<Result<Vec<_>, EstimatorError>>()?;
                let imm = Imm::new(modes, Transition::sojourn(&sojourn_s)?)?;
                Box::new(imm.with_innovation(Kalman::innovation))
            }
            Self::Batch { loss } => {
                let batch = BatchEstimator::new(as_walk(&motion, prior)?, model, *prior)?;
                Box::new(batch.with_loss(loss)?)
            }
            Self::Grid { side, level_noise_spread } => {
                let noise_scales = level_noise_spread.map(noise_scales).transpose()?;
                let config = GridConfig { side, most_per_side: 2 * side, noise_scales, area: None };
                Box::new(GridFilter::new(motion, model, *prior, config)?)
            }
            Self::Particle { count, adaptive_bin } => {
                let rng = generator(count, seed)?;
                let cloud = ParticleFilter::new(motion, model, *prior, count, rng)?;
                match adaptive_bin {
                    Some(bin) => {
                        let size = KldSampling::new(State::repeat(bin), FEWEST.min(count), count)?;
                        Box::new(cloud.with_adaptive_size(size))
                    }
                    None => Box::new(cloud),
                }
            }
            Self::RaoBlackwellised { .. } => {
                #[expect(clippy::cast_precision_loss, reason = "a handful of components")]
                let value = N as f64;
                let (name, requirement) = ("components of the state", "3: a place and a power");
                return Err(EstimatorError::Parameter { name, value, requirement });
            }
        })
    }
}

/// A target at rest: its place drifts, and what else is in its state goes on as it may, a velocity
/// that it does not use among it.
fn still_walk<const N: usize>(
    drift: f64,
    prior: &Estimate<N>,
) -> Result<RandomWalk<N>, EstimatorError> {
    if !(drift >= 0.0 && drift.is_finite()) {
        let (name, requirement) = ("still_drift", "a non-negative number");
        return Err(EstimatorError::Parameter { name, value: drift, requirement });
    }
    // Within ten seconds it may be anything again that it was before anything was heard.
    let rest = |row: usize| (prior.covariance[(row, row)] / 10.0).sqrt();
    Ok(RandomWalk { drift: State::from_fn(|row, _| if row < 2 { drift } else { rest(row) }) })
}

/// A motion that is a random walk, as one.
fn as_walk<const N: usize>(
    motion: &impl MotionModel<N>,
    prior: &Estimate<N>,
) -> Result<RandomWalk<N>, EstimatorError> {
    let noise = motion.noise_factor(&prior.mean, 1.0);
    let drift = noise.diagonal();
    let moved = (motion.propagate(&prior.mean, 1.0) - prior.mean).norm()
        + (noise - SMatrix::from_diagonal(&drift)).norm();
    if moved > 1e-9 {
        let (name, requirement) =
            ("what the target moves in a second", "0: a batch is of one place");
        return Err(EstimatorError::Parameter { name, value: moved, requirement });
    }
    Ok(RandomWalk { drift })
}

/// A log-normal distribution of the factor on a level's σ, at five nodes three quarters of a deviation
/// apart in its logarithm.
fn noise_scales(spread: f64) -> Result<NoiseScales, EstimatorError> {
    if !(spread > 0.0 && spread <= 3.0) {
        let (name, requirement) = ("level_noise_spread", "in (0, 3]");
        return Err(EstimatorError::Parameter { name, value: spread, requirement });
    }
    let node =
        |deviations: f64| ((spread * deviations).exp(), (-0.5 * deviations * deviations).exp());
    Ok(NoiseScales { component: 0, factors: [-1.5, -0.75, 0.0, 0.75, 1.5].map(node).to_vec() })
}

/// The largest cloud that a file may ask for.
const MOST_PARTICLES: usize = 10_000_000;

/// The smallest cloud whose size adapts.
const FEWEST: usize = 500;

/// The generator of a cloud of `count` particles.
///
/// # Errors
///
/// [`EstimatorError::Parameter`] when there are too many: a number from a file must not be able to
/// ask for all memory there is.
pub(super) fn generator(count: usize, seed: u64) -> Result<Xoshiro256PlusPlus, EstimatorError> {
    if count > MOST_PARTICLES {
        #[expect(clippy::cast_precision_loss, reason = "it is only told")]
        let value = count as f64;
        let requirement = "at most 10 000 000";
        return Err(EstimatorError::Parameter { name: "count", value, requirement });
    }
    Ok(Xoshiro256PlusPlus::seed_from_u64(seed))
}

/// One seed for each beacon of a run, so that their filters do not draw the same numbers.
#[must_use]
pub fn beacon_seed(run: u64, beacon: BeaconId) -> u64 {
    // The odd constant is 2⁶⁴ over the golden ratio (Steele et al. 2014, SplitMix).
    run ^ 0x9E37_79B9_7F4A_7C15_u64.wrapping_mul(u64::from(beacon.0) + 1)
}

#[cfg(test)]
mod tests {
    use foxhunt_sensors::{LogDistance, RssBearing};

    use super::*;

    #[test]
    fn an_update_is_linearised_once_unless_told() {
        let read = |kind: &str, rest: &str| {
            let text = format!(r#"{{"kind": "{kind}", "gate": "open"{rest}}}"#);
            serde_json::from_str::<FilterConfig>(&text)
        };
        for (kind, rest) in
            [("ekf", ""), ("cubature", ""), ("ukf", r#", "alpha": 1, "beta": 2, "kappa": 0"#)]
        {
            let bare = read(kind, rest).expect("as it was before there were iterations");
            for (iterations, same) in [(1, true), (2, false)] {
                let told = read(kind, &format!(r#"{rest}, "iterations": {iterations}"#));
                assert_eq!(told.expect("in order") == bare, same, "{kind}, {iterations}");
            }
            let never = read(kind, &format!(r#"{rest}, "iterations": 0"#)).expect("a number");
            let model = RssBearing::new(LogDistance::new(-29.06, 2.765).expect("in range"));
            let (walk, prior) =
                (RandomWalk::uniform(0.1), Estimate::isotropic(State::<2>::zeros(), 1.0));
            let refused = never.build::<_, _, 2, 2>(walk, model, &prior, 0).err();
            assert!(
                matches!(refused, Some(EstimatorError::Parameter { name: "iterations", .. })),
                "{kind}: {refused:?}"
            );
        }
    }
}
