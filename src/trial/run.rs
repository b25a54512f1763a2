use foxhunt_core::{BeaconId, Estimate, Estimator};
use nalgebra::Vector2;

use super::{Trial, TrialError, TrialEstimator, draw::Draw, factory};
use crate::config::beacon_seed;

/// One run of a trial with one estimator.
#[derive(Clone, Debug, PartialEq)]
pub struct TrialRun {
    /// Where the target was at each bearing, East and North in metres.
    pub truth: Vec<Vector2<f64>>,
    /// What the estimator believed after each bearing; shorter than `truth` where it could not
    /// go on.
    pub estimates: Vec<Estimate<2>>,
    /// The normalised innovation squared of each bearing that has one.
    pub nis: Vec<f64>,
    /// How many bearings went through the estimator.
    pub steps: u32,
}

impl TrialRun {
    /// Whether the estimator could not go on.
    #[must_use]
    pub fn failed(&self) -> bool {
        self.estimates.len() < self.truth.len()
    }
}

/// Runs a trial once; the same trial, estimator and seed give the same run, and every estimator
/// hears the same bearings.
///
/// # Errors
///
/// [`TrialError`] when the estimator cannot be built or does not suit the trial. One that cannot
/// go on ends the run, which [`TrialRun::failed`] tells.
pub fn run_trial(
    trial: &Trial,
    estimator: &TrialEstimator,
    seed: u64,
) -> Result<TrialRun, TrialError> {
    let draw = Draw::new(trial, seed)?;
    let own_seed = beacon_seed(seed, BeaconId(0));
    Ok(match trial.moving() {
        None => {
            let still = factory::still();
            follow(trial, &draw, estimator.build::<_, 2>(trial, still, &draw.prior, own_seed)?)
        }
        Some(moving) => {
            follow(trial, &draw, estimator.build_moving(trial, moving, &draw.prior, own_seed)?)
        }
    })
}

fn follow<const N: usize>(
    trial: &Trial,
    draw: &Draw,
    mut estimator: Box<dyn Estimator<N, 1>>,
) -> TrialRun {
    let truth = draw.truth.iter().map(|state| state.xy()).collect();
    let mut run = TrialRun { truth, estimates: Vec::new(), nis: Vec::new(), steps: 0 };
    for (k, heard) in draw.heard.iter().enumerate() {
        let elapsed = if k == 0 { 0.0 } else { trial.bearings.interval_s };
        if estimator.predict(elapsed).is_err() {
            break;
        }
        if k > 0 || !draw.prior.holds_first_bearing() {
            let Ok(correction) = estimator.update(heard) else { break };
            run.nis.extend(correction.nis());
            run.steps += 1;
        }
        run.estimates.push(estimator.estimate().position());
    }
    run
}
