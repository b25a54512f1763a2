use std::convert::Infallible;

use foxhunt_core::Outcome;
use foxhunt_filters::consistency::{ChiSquaredAverage, Coverage, Verdict};
use rayon::prelude::*;
use serde::Serialize;

use super::{Spread, StepSpread};
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
    /// Whether the errors are as large as the estimator says, by the ANEES.
    pub verdict: Verdict,
    /// The share of truths inside the 95 % ellipse.
    pub coverage_95: Option<f64>,
    /// Where the true share lies with at least 95 %.
    pub coverage_95_interval: Option<[f64; 2]>,
    /// The average normalised innovation squared over all steps that have one.
    pub anis: Option<f64>,
    /// Where a consistent estimator's ANIS lies with 95 %.
    pub anis_interval: Option<[f64; 2]>,
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
    /// Its normalised innovations squared with their degrees of freedom.
    nis: Vec<(f64, usize)>,
}

/// One run's beacons, as far as it came.
fn fly(
    scenario: &Scenario,
    estimator: &NamedEstimator,
    seed: u64,
) -> Result<Vec<BeaconRun>, SimulationError> {
    let track = &estimator.config.track;
    let mut nis: Vec<Vec<(f64, usize)>> = Vec::new();
    let mut components = 0;
    let flown = simulate(scenario, estimator, seed, |event| {
        match event {
            Event::BeaconStarted { .. } => nis.push(Vec::new()),
            Event::Received { first_position, reception, .. } => {
                components = track.degrees_of_freedom(reception, *first_position);
            }
            Event::Corrected { correction, .. } => {
                if let (Some(value), Some(beacon)) = (correction.nis(), nis.last_mut()) {
                    beacon.push((value, components));
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
    Ok(found.into_iter().zip(nis).map(|(found, nis)| BeaconRun { found, nis }).collect())
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
        let (mut anees, mut anis) = (ChiSquaredAverage::default(), ChiSquaredAverage::default());
        let mut coverage = Coverage::new(0.95, 0.95).expect("both are in (0, 1)");
        for (run, nees) in &good {
            anees.add(*nees, 2);
            coverage.add_nees(*nees);
            anis.extend(run.nis.iter().copied());
        }
        BeaconCampaign {
            name: beacon.name.clone(),
            error_m: Spread::of(&column(&|run| run.found.error_m())),
            steps: StepSpread::of(&column(&|run| f64::from(run.found.fix.steps))),
            anees: anees.average(),
            anees_interval: anees.interval(),
            verdict: anees.verdict(),
            coverage_95: coverage.share(),
            coverage_95_interval: coverage.interval(),
            anis: anis.average(),
            anis_interval: anis.interval(),
            failed: total - count,
        }
    };
    scenario.world.beacons.iter().enumerate().map(beacon).collect()
}

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
