//! Campaigns of trials, and the Cramér-Rao bounds that their errors are held against.

use foxhunt_core::{ConstantVelocity, Observation};
use foxhunt_filters::{PosteriorCramerRao, consistency::ChiSquaredAverage};
use foxhunt_hunt::registry::EstimatorEntry;
use foxhunt_sensors::{BearingMixture, BearingOnly};
use nalgebra::{Matrix1, Matrix4, Vector1};

use super::{TargetConfig, TargetMotion, Trial, TrialError, TrialRun, draw::Draw, run_trial};
use crate::{
    Experiment, Runner,
    campaign::{
        BeaconCampaign, BeaconSummary, CampaignReport, Checkpoint, EstimatorCampaign, Repetition,
        Sample,
    },
    experiment::seed_of,
};

/// More trajectories than this change an average by less than is shown.
const MOST: usize = 500;

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

/// The bound on the root mean square error of the place after each bearing, in metres, from the
/// trajectories that were drawn (Tichavský, Muravchik & Nehorai 1998).
///
/// Nothing where there is no such bound: where the prior has no density with a slope, as that of a
/// room, and where the target does not move as the estimators take it to.
fn bounds(trial: &Trial, seeds: impl Iterator<Item = u64>) -> Vec<Option<f64>> {
    let of_bearings = trial.differences.is_none();
    let Some(motion) = trial.moving().filter(|_| of_bearings && as_modelled(trial)) else {
        return Vec::new();
    };
    let draws: Vec<Draw> = seeds.take(MOST).map(|seed| Draw::new(trial, seed)).collect();
    recursion(trial, &motion, &draws).unwrap_or_default()
}

/// Returns true if the truth moves as the estimators assume.
fn as_modelled(trial: &Trial) -> bool {
    let assumed = match trial.motion {
        TargetMotion::Still => 0.0,
        TargetMotion::ConstantVelocity { spectral_density } => spectral_density,
    };
    let true_density = match trial.target {
        TargetConfig::Line { spectral_density, .. } => spectral_density,
        TargetConfig::FromPrior => 0.0,
        TargetConfig::Circle { .. } => return false,
    };
    (assumed - true_density).abs() <= 1e-12 * assumed
}

fn recursion(trial: &Trial, motion: &ConstantVelocity, draws: &[Draw]) -> Option<Vec<Option<f64>>> {
    let bearings = &trial.bearings;
    // All that counts of a density about a location is its Fisher information.
    let density =
        BearingMixture::new(bearings.outlier_share, bearings.bias_rad, bearings.sigma_rad).ok()?;
    let noise = Matrix1::new(1.0 / density.fisher_information());
    let first = draws.first()?;
    let count = f64::from(u32::try_from(draws.len()).ok()?);
    let at_first = draws.iter().map(|draw| draw.prior.information(&draw.truth[0]));
    let information: Matrix4<f64> = at_first.sum::<Option<Matrix4<f64>>>()? / count;
    let mut bound = PosteriorCramerRao::from_information(information).ok()?;
    let states = |k: usize| draws.iter().map(move |draw| draw.truth[k]);
    let mut bounds = Vec::with_capacity(first.truth.len());
    for k in 0..first.truth.len() {
        if k > 0 {
            bound.predict(motion, states(k - 1), bearings.interval_s).ok()?;
        }
        if k > 0 || !first.prior.holds_first_bearing() {
            let observations = draws.iter().map(|draw| {
                let reception = &draw.receptions[k];
                let angle = reception.bearing.map_or(0.0, |bearing| bearing.angle);
                Observation::new(reception.time, reception.receiver, Vector1::new(angle), noise)
            });
            let observations = observations.collect::<Result<Vec<_>, _>>().ok()?;
            bound.update(&BearingOnly::new(), states(k).zip(observations)).ok()?;
        }
        let covariance = bound.covariance().ok();
        let rms = covariance.map(|c| (c[(0, 0)] + c[(1, 1)]).sqrt());
        bounds.push(rms.filter(|rms| rms.is_finite()));
    }
    Some(bounds)
}
