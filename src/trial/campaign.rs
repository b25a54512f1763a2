use rayon::prelude::*;

use super::{Trial, TrialError, TrialEstimator, TrialRun, bound::bounds, run_trial};
use crate::campaign::{BeaconCampaign, CampaignReport, Checkpoint, EstimatorCampaign, Sample};

/// Runs a trial `runs` times with each estimator on `jobs` threads, as
/// [`campaign`](crate::campaign::campaign) flies a scenario; the target is its one beacon. Besides
/// the error after the last bearing it tells those at the trial's checkpoints and the root mean
/// square over all bearings, and the posterior Cramér-Rao bound of each where there is one.
///
/// # Errors
///
/// [`TrialError`] when an estimator cannot be built or does not suit the trial. A single run that
/// goes wrong is counted in [`BeaconCampaign::failed`].
pub fn trial_campaign(
    trial: &Trial,
    estimators: &[TrialEstimator],
    runs: u32,
    seed: u64,
    jobs: usize,
    progress: &(dyn Fn() + Sync),
) -> Result<CampaignReport, TrialError> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(jobs)
        .build()
        .map_err(|error| TrialError::Threads { jobs, reason: error.to_string() })?;
    let seed_of = |run: u32| seed.wrapping_add(u64::from(run));
    let bounds = bounds(trial, (0..runs).map(seed_of))?;
    let estimators = estimators
        .iter()
        .map(|estimator| {
            let one = |run: u32| {
                let outcome = run_trial(trial, estimator, seed_of(run));
                progress();
                outcome
            };
            let all = pool.install(|| {
                (0..runs).into_par_iter().map(one).collect::<Result<Vec<_>, TrialError>>()
            })?;
            let beacons = vec![summarise(trial, &all, runs, &bounds)];
            Ok(EstimatorCampaign { estimator: estimator.name.to_owned(), beacons })
        })
        .collect::<Result<_, TrialError>>()?;
    Ok(CampaignReport { scenario: trial.name.clone(), planner: None, runs, seed, estimators })
}

fn summarise(
    trial: &Trial,
    runs: &[TrialRun],
    total: u32,
    bounds: &[Option<f64>],
) -> BeaconCampaign {
    let good: Vec<&TrialRun> = runs.iter().filter(|run| !run.failed()).collect();
    let index = |bearings: u32| usize::try_from(bearings).unwrap_or(usize::MAX).saturating_sub(1);
    let bound_at = |bearings: u32| bounds.get(index(bearings)).copied().flatten();
    let samples_at = |bearings: u32| -> Vec<Sample> {
        let index = index(bearings);
        good.iter().filter_map(|run| sample(run, index)).collect()
    };
    let mut beacon = BeaconCampaign::of("target", &samples_at(trial.bearings.count), total);
    beacon.checkpoints = trial
        .checkpoints
        .iter()
        .map(|&bearings| Checkpoint {
            bound_m: bound_at(bearings),
            ..Checkpoint::of(bearings, &samples_at(bearings))
        })
        .collect();
    beacon.bound_m = bound_at(trial.bearings.count);
    let squares: Vec<f64> = good
        .iter()
        .flat_map(|run| run.estimates.iter().zip(&run.truth))
        .map(|(estimate, truth)| (estimate.mean - truth).norm_squared())
        .collect();
    let count = f64::from(u32::try_from(squares.len()).unwrap_or(u32::MAX));
    beacon.track_rms_m =
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / count).sqrt());
    beacon
}

/// What a run says after some bearing.
fn sample(run: &TrialRun, index: usize) -> Option<Sample> {
    let (estimate, truth) = (run.estimates.get(index)?, run.truth.get(index)?);
    let sample = Sample {
        error_m: (estimate.mean - truth).norm(),
        nees: estimate.nees(truth)?,
        steps: run.steps,
        // A bearing is one component.
        nis: run.nis.iter().map(|nis| (*nis, 1)).collect(),
    };
    (sample.error_m.is_finite() && sample.nees.is_finite()).then_some(sample)
}
