use foxhunt_core::{BeaconId, Estimate};
use foxhunt_hunt::{
    hunt::{Track, TrackStep},
    registry::{EstimatorEntry, beacon_seed},
};
use nalgebra::Vector2;

use super::{Trial, TrialError, draw::Draw, track::track};

/// One run of a trial with one estimator.
#[derive(Clone, Debug, PartialEq)]
pub struct TrialRun {
    /// The target's place at each bearing, East and North in metres.
    pub truth: Vec<Vector2<f64>>,
    /// The estimate after each bearing; shorter than `truth` if the estimator could not go on.
    pub estimates: Vec<Estimate<2>>,
    /// The normalised innovation squared of each bearing that has one.
    pub nis: Vec<f64>,
    /// The number of bearings that went through the estimator.
    pub steps: u32,
}

impl TrialRun {
    /// Returns true if the estimator could not go on.
    #[must_use]
    pub fn failed(&self) -> bool {
        self.estimates.len() < self.truth.len()
    }
}

/// Runs a trial once; the same trial, estimator and seed give the same run, and every estimator
/// gets the same bearings.
///
/// # Errors
///
/// [`TrialError`] when the estimator cannot be built or does not suit the trial. One that cannot
/// go on ends the run, which [`TrialRun::failed`] is about.
pub fn run_trial(
    trial: &Trial,
    estimator: &EstimatorEntry,
    seed: u64,
) -> Result<TrialRun, TrialError> {
    let draw = Draw::new(trial, seed);
    let own_seed = beacon_seed(seed, BeaconId(0));
    Ok(follow(&draw, track(trial, estimator, &draw.prior, own_seed)?))
}

fn follow(draw: &Draw, mut track: Track) -> TrialRun {
    let truth = draw.truth.iter().map(|state| state.xy()).collect();
    let mut run = TrialRun { truth, estimates: Vec::new(), nis: Vec::new(), steps: 0 };
    for (k, reception) in draw.receptions.iter().enumerate() {
        if k > 0 || !draw.prior.holds_first_bearing() {
            let Ok(TrackStep::Updated { correction, .. }) = track.update(reception, false) else {
                break;
            };
            run.nis.extend(correction.nis());
            run.steps += 1;
        }
        run.estimates.push(track.position());
    }
    run
}
