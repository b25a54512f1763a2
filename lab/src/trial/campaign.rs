use foxhunt_filters::consistency::ChiSquaredAverage;
use foxhunt_hunt::registry::EstimatorEntry;

use super::{Trial, TrialError, TrialRun, bound::bounds, run_trial};
use crate::{
    Experiment, Runner,
    campaign::{
        BeaconCampaign, BeaconSummary, CampaignReport, Checkpoint, EstimatorCampaign, Repetition,
        Sample,
    },
    experiment::seed_of,
};

/// Runs a trial with each estimator, as [`campaign`](crate::campaign::campaign) flies a scenario;
/// the target is its one beacon. Besides the error after the last bearing it has those at the
/// trial's checkpoints and the root mean square over all bearings, and the posterior Cramér-Rao
/// bound of each where there is one.
///
/// # Errors
///
/// [`TrialError`] when an estimator cannot be built or does not suit the trial. A single run that
/// goes wrong is counted in [`BeaconCampaign::failed`].
pub fn trial_campaign(
    trial: &Trial,
    estimators: &[EstimatorEntry],
    repetition: &Repetition<'_>,
) -> Result<CampaignReport, TrialError> {
    let runner = Runner::new(repetition.jobs)?;
    let Repetition { runs, seed, .. } = *repetition;
    let bounds = bounds(trial, (0..runs).map(|run| seed_of(seed, run)));
    let estimators = estimators
        .iter()
        .map(|estimator| {
            let all = repetition.of(&runner, &Trials { trial, estimator })?;
            let beacons = vec![summarise(trial, &all, runs, &bounds)];
            Ok(EstimatorCampaign { estimator: estimator.name.clone().into_owned(), beacons })
        })
        .collect::<Result<_, TrialError>>()?;
    Ok(CampaignReport { scenario: trial.name.clone(), planner: None, runs, seed, estimators })
}

/// A trial with one estimator.
struct Trials<'a> {
    trial: &'a Trial,
    estimator: &'a EstimatorEntry,
}

impl Experiment for Trials<'_> {
    type Run = TrialRun;
    type Error = TrialError;

    fn run(&self, seed: u64) -> Result<TrialRun, TrialError> {
        run_trial(self.trial, self.estimator, seed)
    }
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
    let mut summary = BeaconSummary::default();
    samples_at(trial.bearings.count).iter().for_each(|sample| summary.add(sample));
    let mut beacon = summary.report("target", total);
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

/// The figures of a run after some bearing.
fn sample(run: &TrialRun, index: usize) -> Option<Sample> {
    let estimate = run.estimates.get(index)?;
    let truth = run.truth.get(index)?;
    let mut nis = ChiSquaredAverage::default();
    // A bearing is one component.
    nis.extend(run.nis.iter().map(|nis| (*nis, 1)));
    let sample = Sample {
        error_m: (estimate.mean - truth).norm(),
        nees: estimate.nees(truth)?,
        steps: run.steps,
        nis: nis.sums(),
    };
    (sample.error_m.is_finite() && sample.nees.is_finite()).then_some(sample)
}
