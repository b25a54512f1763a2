use std::convert::Infallible;

use foxhunt_core::Outcome;
use rayon::prelude::*;
use serde::Serialize;

use super::{Spread, StepSpread, average_interval};
use crate::{
    config::NamedEstimator,
    hunt::Event,
    scenario::Scenario,
    simulation::{Found, SimulationError, simulate},
};

/// What a campaign came to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CampaignReport {
    /// The scenario's name.
    pub scenario: String,
    /// How many hunts each estimator flew.
    pub runs: u32,
    /// The seed of the first run; run i has this plus i.
    pub seed: u64,
    /// The estimators, in the order in which they were asked for.
    pub estimators: Vec<EstimatorCampaign>,
}

/// One estimator's campaign.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EstimatorCampaign {
    /// The estimator's name.
    pub estimator: String,
    /// The beacons, in their order.
    pub beacons: Vec<BeaconCampaign>,
}

/// One estimator on one beacon over all runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BeaconCampaign {
    /// The beacon's name.
    pub name: String,
    /// From the estimate to the truth; absent when every run failed, like all that follows.
    pub error_m: Option<Spread>,
    /// Receptions that went through the estimator.
    pub steps: Option<StepSpread>,
    /// The average normalised estimation error squared; 2 for a consistent estimator.
    pub anees: Option<f64>,
    /// Where a consistent estimator's ANEES lies with 95 %.
    pub anees_interval: Option<[f64; 2]>,
    /// The share of truths inside the 95 % ellipse.
    pub coverage_95: Option<f64>,
    /// The average normalised innovation squared over all steps that have one.
    pub anis: Option<f64>,
    /// Runs without a fix: nothing heard, not over in time, or an estimate without a positive
    /// definite covariance.
    pub failed: u32,
}

/// Flies a scenario `runs` times with each estimator on `jobs` threads. Run i has the seed
/// `seed` + i, for every estimator the same; the result does not depend on `jobs`. `progress` is
/// called after each run, from any thread.
///
/// # Errors
///
/// [`CampaignError`] when the scenario or an estimator cannot be built. A single run that goes
/// wrong is counted in [`BeaconCampaign::failed`].
pub fn campaign(
    scenario: &Scenario,
    estimators: &[NamedEstimator],
    runs: u32,
    seed: u64,
    jobs: usize,
    progress: &(dyn Fn() + Sync),
) -> Result<CampaignReport, CampaignError> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(jobs)
        .build()
        .map_err(|error| CampaignError::Threads { jobs, reason: error.to_string() })?;
    let estimators = estimators
        .iter()
        .map(|estimator| {
            let fly = |run: u32| {
                let outcome = fly(scenario, estimator, seed.wrapping_add(u64::from(run)));
                progress();
                outcome
            };
            let flown = pool.install(|| {
                (0..runs).into_par_iter().map(fly).collect::<Result<Vec<_>, SimulationError>>()
            });
            Ok(EstimatorCampaign {
                estimator: estimator.name.to_owned(),
                beacons: summarise(scenario, &flown?),
            })
        })
        .collect::<Result<_, CampaignError>>()?;
    Ok(CampaignReport { scenario: scenario.name.clone(), runs, seed, estimators })
}

/// What one run says of one beacon.
#[derive(Clone, Debug)]
struct BeaconRun {
    found: Found,
    nis_sum: f64,
    nis_count: u32,
}

/// One run's beacons, as far as it came.
fn fly(
    scenario: &Scenario,
    estimator: &NamedEstimator,
    seed: u64,
) -> Result<Vec<BeaconRun>, SimulationError> {
    let mut nis: Vec<(f64, u32)> = Vec::new();
    let flown = simulate(scenario, estimator, seed, |event| {
        match event {
            Event::BeaconStarted { .. } => nis.push((0.0, 0)),
            Event::Corrected { correction, .. } => {
                if let (Some(value), Some((sum, count))) = (correction.nis(), nis.last_mut()) {
                    *sum += value;
                    *count += 1;
                }
            }
            _ => {}
        }
        Ok::<_, Infallible>(())
    });
    let found = match flown {
        Ok(hunt) => hunt.found,
        // The hunt itself could not go on: a failed run. A scenario that cannot be built would
        // fail every run alike and is an error.
        Err(SimulationError::TooLong { .. } | SimulationError::Drive(_)) => Vec::new(),
        Err(error) => return Err(error),
    };
    let with_nis = |(found, (nis_sum, nis_count))| BeaconRun { found, nis_sum, nis_count };
    Ok(found.into_iter().zip(nis).map(with_nis).collect())
}

fn summarise(scenario: &Scenario, runs: &[Vec<BeaconRun>]) -> Vec<BeaconCampaign> {
    let beacon = |(index, beacon): (usize, &foxhunt_sim::BeaconConfig)| {
        let good: Vec<(&BeaconRun, f64)> = runs
            .iter()
            .filter_map(|run| run.get(index))
            .filter(|run| run.found.fix.outcome != Outcome::NothingHeard)
            .filter_map(|run| Some((run, run.found.nees()?)))
            .filter(|(run, nees)| nees.is_finite() && run.found.error_m().is_finite())
            .collect();
        let column = |value: &dyn Fn(&BeaconRun) -> f64| -> Vec<f64> {
            good.iter().map(|(run, _)| value(run)).collect()
        };
        let count = u32::try_from(good.len()).unwrap_or(u32::MAX);
        let total = u32::try_from(runs.len()).unwrap_or(u32::MAX);
        let average = |sum: f64, count: u32| (count > 0).then(|| sum / f64::from(count));
        let inside = good.iter().filter(|(_, nees)| *nees <= NEES_95).count();
        let innovations = good.iter().map(|(run, _)| run.nis_count).sum();
        BeaconCampaign {
            name: beacon.name.clone(),
            error_m: Spread::of(&column(&|run| run.found.error_m())),
            steps: StepSpread::of(&column(&|run| f64::from(run.found.fix.steps))),
            anees: average(good.iter().map(|(_, nees)| nees).sum(), count),
            anees_interval: average_interval(2.0, count),
            coverage_95: average(f64::from(u32::try_from(inside).unwrap_or(u32::MAX)), count),
            anis: average(good.iter().map(|(run, _)| run.nis_sum).sum(), innovations),
            failed: total - count,
        }
    };
    scenario.world.beacons.iter().enumerate().map(beacon).collect()
}

/// The 95 % quantile of χ² with two degrees of freedom, −2 ln 0.05.
const NEES_95: f64 = 5.991_464_547_107_979;

/// Why there is no campaign.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CampaignError {
    /// The threads could not be started.
    #[error("{jobs} threads cannot be started: {reason}")]
    Threads {
        /// How many.
        jobs: usize,
        /// Why not.
        reason: String,
    },
    /// A hunt could not be built.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
}
