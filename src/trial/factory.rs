use std::sync::Arc;

use foxhunt_core::{
    ConstantVelocity, Estimate, Estimator, EstimatorError, MotionModel, RandomWalk,
};
use foxhunt_filters::{Ckf, GaussianSum, Imm, Iterations, Kalman, ParticleFilter, Transition, Ukf};
use foxhunt_sensors::BearingOnly;
use nalgebra::Vector4;
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

use super::{
    TargetMotion, Trial, TrialError,
    prior::{Prior, leading, leading_estimate},
};
use crate::config::{FilterConfig, GateConfig, estimator_named};

/// An estimator that a trial knows by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrialEstimator {
    /// Its name, as `--estimator` takes it.
    pub name: &'static str,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// The filter of the same name that hunts fly with, begun from the prior's moments.
    Named,
    /// A cloud drawn from the prior itself.
    Particle,
    /// Components side by side over the whole prior.
    GaussianSum,
    /// Components with ranges in geometric progression.
    RangeParameterised,
    /// A still and a moving model.
    Imm,
}

/// Every estimator that a trial knows, each by a name that hunts know, too.
#[must_use]
pub fn trial_estimators() -> Vec<TrialEstimator> {
    let named = ["ekf", "ekf-iterated", "ukf", "cubature", "iterated-posterior-linearisation"];
    let own = [
        ("particle", Kind::Particle),
        ("gaussian-sum", Kind::GaussianSum),
        ("range-parameterised", Kind::RangeParameterised),
        ("imm", Kind::Imm),
    ];
    let named = named.into_iter().map(|name| (name, Kind::Named));
    named.chain(own).map(|(name, kind)| TrialEstimator { name, kind }).collect()
}

/// The trial's estimator of a name.
#[must_use]
pub fn trial_estimator_named(name: &str) -> Option<TrialEstimator> {
    trial_estimators().into_iter().find(|known| known.name == name)
}

/// Gaussians in each direction of a room, or along the range and along the course.
const SUM: [usize; 2] = [7, 7];

/// Gaussians along the range and along the course.
const ROW: [usize; 2] = [7, 5];

/// How often each component is linearised.
const ITERATIONS: u32 = 10;

/// How long a still target stays still and a moving one moves, on average, in seconds.
const SOJOURN_S: [f64; 2] = [60.0, 60.0];

impl TrialEstimator {
    /// Builds the estimator for one run, of a state of N = 2 or 4 components under `motion`.
    pub(super) fn build<F, const N: usize>(
        &self,
        trial: &Trial,
        motion: F,
        prior: &Prior,
        seed: u64,
    ) -> Result<Box<dyn Estimator<N, 1>>, TrialError>
    where
        F: MotionModel<N> + Clone + 'static,
    {
        let model = model(trial)?;
        let moments: Estimate<N> = leading_estimate(&prior.moments());
        let sum_of = |parts: Vec<(f64, Estimate<4>)>, iterations: u32| {
            sum_of(trial, Ckf::new(motion.clone(), model, moments)?, &parts, iterations)
        };
        let unsuited = |needs| TrialError::Unsuited {
            estimator: self.name.to_owned(),
            trial: trial.name.clone(),
            needs,
        };
        Ok(match self.kind {
            Kind::Named => {
                let known = estimator_named(self.name).ok_or_else(|| unsuited("a name"))?;
                let filter = behind(known.config.filter, gate(trial));
                filter.build(motion, model, &moments, seed)?
            }
            Kind::Particle => {
                let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
                let draw = |_| leading(&prior.draw(&mut rng));
                let cloud: Vec<_> = (0..trial.particles).map(draw).collect();
                Box::new(ParticleFilter::from_samples(motion, model, &cloud, rng)?)
            }
            Kind::GaussianSum => sum_of(prior.sum(SUM)?, 1)?,
            Kind::RangeParameterised => {
                let row = prior.row(ROW)?;
                sum_of(row.ok_or_else(|| unsuited("a prior of ranging"))?, ITERATIONS)?
            }
            Kind::Imm => return Err(unsuited("a target that moves")),
        })
    }

    /// Builds the estimator of a target that moves.
    pub(super) fn build_moving(
        &self,
        trial: &Trial,
        moving: ConstantVelocity,
        prior: &Prior,
        seed: u64,
    ) -> Result<Box<dyn Estimator<4, 1>>, TrialError> {
        if self.kind != Kind::Imm {
            return self.build(trial, moving, prior, seed);
        }
        // A still target keeps a velocity to go on with; its place drifts by a tenth of what the
        // moving one's acceleration makes in a sojourn.
        let drift = 0.1 * moving.acceleration_density * SOJOURN_S[0];
        let velocity = moving.acceleration_density;
        let still = RandomWalk { drift: Vector4::new(drift, drift, velocity, velocity) };
        let motions: [Arc<dyn MotionModel<4> + Send + Sync>; 2] =
            [Arc::new(still), Arc::new(moving)];
        let (model, moments) = (model(trial)?, prior.moments());
        let models = motions
            .into_iter()
            .map(|motion| {
                Ok((0.5, Ukf::new(motion, model, moments)?.with_gate(gate(trial).build()?)))
            })
            .collect::<Result<Vec<_>, EstimatorError>>()?;
        let imm = Imm::new(models, Transition::sojourn(&SOJOURN_S)?)?;
        Ok(Box::new(imm.with_innovation(Kalman::innovation)))
    }
}

/// A Gaussian sum of copies of one filter, which knows of the trial's outliers.
fn sum_of<F, const N: usize>(
    trial: &Trial,
    filter: Ckf<F, BearingOnly, N, 1>,
    parts: &[(f64, Estimate<4>)],
    iterations: u32,
) -> Result<Box<dyn Estimator<N, 1>>, EstimatorError>
where
    F: MotionModel<N> + Clone + 'static,
{
    let filter = filter.with_iterations(Iterations::at_most(iterations)?);
    let parts = parts.iter().map(|(weight, part)| (*weight, leading_estimate(part)));
    let (sum, share) = (GaussianSum::new(&filter, parts)?, trial.bearings.outlier_share);
    // A bearing that is none points anywhere.
    let anywhere = 1.0 / core::f64::consts::TAU;
    Ok(Box::new(if share > 0.0 { sum.with_outliers(share, anywhere)? } else { sum }))
}

/// What keeps outliers from a Kalman filter: nothing where there are none, as a gate would shut out
/// bearings that are far from what a poor linearisation expects.
fn gate(trial: &Trial) -> GateConfig {
    if trial.bearings.outlier_share > 0.0 {
        GateConfig::Probability(0.999)
    } else {
        GateConfig::Open
    }
}

/// The filter behind another gate.
fn behind(filter: FilterConfig, gate: GateConfig) -> FilterConfig {
    match filter {
        FilterConfig::Ekf { iterations, .. } => FilterConfig::Ekf { gate, iterations },
        FilterConfig::Cubature { iterations, outliers, .. } => {
            FilterConfig::Cubature { gate, outliers, iterations }
        }
        FilterConfig::Ukf { alpha, beta, kappa, iterations, .. } => {
            FilterConfig::Ukf { gate, alpha, beta, kappa, iterations }
        }
        other => other,
    }
}

/// The density of the trial's bearings.
fn model(trial: &Trial) -> Result<BearingOnly, TrialError> {
    let bearings = &trial.bearings;
    let model = BearingOnly::new().with_bias(bearings.bias_rad)?;
    Ok(if bearings.outlier_share > 0.0 {
        model.with_outliers(bearings.outlier_share)?
    } else {
        model
    })
}

/// The motion of a still target's two components: not at all.
pub(super) fn still() -> RandomWalk<2> {
    RandomWalk::uniform(0.0)
}

impl Trial {
    /// The motion of a target with velocity, if that is what the trial has.
    pub(super) fn moving(&self) -> Option<ConstantVelocity> {
        match self.motion {
            TargetMotion::Still => None,
            TargetMotion::ConstantVelocity { acceleration_density } => {
                Some(ConstantVelocity { acceleration_density })
            }
        }
    }
}
