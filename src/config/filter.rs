use foxhunt_core::{
    BeaconId, Estimate, Estimator, EstimatorError, MeasurementModel, RandomWalk, State,
};
use foxhunt_filters::{Ckf, Ekf, Gate, Iterations, ParticleFilter, Ukf, Unscented};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};
use serde::{Deserialize, Serialize};

/// A filter chosen at run time.
///
/// `drift` is the random walk of the target's East and North: metres per √second, or per step
/// where a prediction counts steps. `iterations` is how often, at most, an update of the Kalman
/// family is linearised; 1 unless given.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum FilterConfig {
    /// The extended Kalman filter.
    Ekf {
        /// The target's random walk.
        drift: f64,
        /// What keeps outliers out.
        gate: GateConfig,
        /// How often an update is linearised, each time about its own posterior.
        #[serde(default = "once")]
        iterations: u32,
    },
    /// The cubature Kalman filter.
    Cubature {
        /// The target's random walk.
        drift: f64,
        /// What keeps outliers out.
        gate: GateConfig,
        /// How often an update is linearised, each time about its own posterior.
        #[serde(default = "once")]
        iterations: u32,
    },
    /// The unscented Kalman filter.
    Ukf {
        /// The target's random walk.
        drift: f64,
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
    /// The particle filter: bootstrap proposals, regularised resampling.
    Particle {
        /// The target's random walk.
        drift: f64,
        /// How many particles.
        count: usize,
    },
}

/// The default of `iterations`.
const fn once() -> u32 {
    1
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
    fn build(self) -> Result<Gate, EstimatorError> {
        match self {
            Self::Open => Ok(Gate::open()),
            Self::Probability(probability) => Gate::probability(probability),
            Self::Pritzl2018 => Ok(Gate::pritzl2018()),
        }
    }
}

/// The random walk of state components behind East and North, such as an unknown reference power
/// in dB per √second: enough that a particle filter does not freeze on its first draws.
const NUISANCE_DRIFT: f64 = 0.02;

impl FilterConfig {
    /// Builds the filter over a model and a prior; `seed` is for those that draw random numbers.
    ///
    /// # Errors
    ///
    /// [`EstimatorError`] when the prior or a parameter does not make one.
    pub fn build<H, const N: usize, const M: usize>(
        &self,
        model: H,
        prior: &Estimate<N>,
        seed: u64,
    ) -> Result<Box<dyn Estimator<N, M>>, EstimatorError>
    where
        H: MeasurementModel<N, M> + 'static,
    {
        Ok(match *self {
            Self::Ekf { drift, gate, iterations } => Box::new(
                Ekf::new(walk(drift)?, model, *prior)?
                    .with_gate(gate.build()?)
                    .with_iterations(Iterations::at_most(iterations)?),
            ),
            Self::Cubature { drift, gate, iterations } => Box::new(
                Ckf::new(walk(drift)?, model, *prior)?
                    .with_gate(gate.build()?)
                    .with_iterations(Iterations::at_most(iterations)?),
            ),
            Self::Ukf { drift, gate, alpha, beta, kappa, iterations } => Box::new(
                Ukf::new(walk(drift)?, model, *prior)?
                    .with_transform(Unscented::new(alpha, beta, kappa)?)?
                    .with_gate(gate.build()?)
                    .with_iterations(Iterations::at_most(iterations)?),
            ),
            Self::Particle { drift, count } => {
                // A number from a file must not be able to ask for all memory there is.
                if count > MOST_PARTICLES {
                    #[expect(clippy::cast_precision_loss, reason = "it is only told")]
                    let value = count as f64;
                    let requirement = "at most 10 000 000";
                    return Err(EstimatorError::Parameter { name: "count", value, requirement });
                }
                let rng = Xoshiro256PlusPlus::seed_from_u64(seed);
                Box::new(ParticleFilter::new(walk(drift)?, model, *prior, count, rng)?)
            }
        })
    }
}

/// The largest cloud that a file may ask for.
const MOST_PARTICLES: usize = 10_000_000;

/// One seed for each beacon of a run, so that their filters do not draw the same numbers.
#[must_use]
pub(crate) fn beacon_seed(run: u64, beacon: BeaconId) -> u64 {
    // The odd constant is 2⁶⁴ over the golden ratio (Steele et al. 2014, SplitMix).
    run ^ 0x9E37_79B9_7F4A_7C15_u64.wrapping_mul(u64::from(beacon.0) + 1)
}

fn walk<const N: usize>(drift: f64) -> Result<RandomWalk<N>, EstimatorError> {
    if !(drift >= 0.0 && drift.is_finite()) {
        return Err(EstimatorError::Parameter {
            name: "drift",
            value: drift,
            requirement: "a non-negative number",
        });
    }
    let drift = State::from_fn(|row, _| if row < 2 { drift } else { NUISANCE_DRIFT });
    Ok(RandomWalk { drift })
}

#[cfg(test)]
mod tests {
    use foxhunt_sensors::{LogDistance, RssBearing};

    use super::*;

    #[test]
    fn an_update_is_linearised_once_unless_told() {
        let read = |kind: &str, rest: &str| {
            let text = format!(r#"{{"kind": "{kind}", "drift": 0.1, "gate": "open"{rest}}}"#);
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
            let prior = Estimate::isotropic(State::<2>::zeros(), 1.0);
            let refused = never.build::<_, 2, 2>(model, &prior, 0).err();
            assert!(
                matches!(refused, Some(EstimatorError::Parameter { name: "iterations", .. })),
                "{kind}: {refused:?}"
            );
        }
    }
}
