use std::{convert::Infallible, mem};

use foxhunt_core::Outcome;
use foxhunt_filters::consistency::{ChiSquaredAverage, Coverage, Verdict};
use rayon::{ThreadPool, ThreadPoolBuilder, prelude::*};
use serde::Serialize;

use super::{FirstPassage, Spread, StepSpread};
use crate::{
    config::NamedEstimator,
    hunt::Event,
    scenario::Scenario,
    simulation::{Found, SearchProgress, SimulationError, simulate},
};

/// What a report calls a planner or an estimator that is the scenario's own.
pub const OWN: &str = "scenario's own";

/// What a campaign came to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CampaignReport {
    /// The scenario's name.
    pub scenario: String,
    /// The planner: the scenario's own, [`OWN`], until whoever asks for another one says its name;
    /// absent where nothing flies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub planner: Option<String>,
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
    /// After how many steps the semi-major axis of the 95 % ellipse was below 3 m for the first
    /// time, over all runs; absent where nothing flies. A run that could not go on never got
    /// there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps_to_3m: Option<FirstPassage>,
    /// The same in simulated seconds, from when the search for this beacon began.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_to_3m_s: Option<FirstPassage>,
    /// How far all drones together flew from the beginning of the search to its end, in metres,
    /// over the runs in which it ended; absent where nothing flies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path_m: Option<Spread>,
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
    /// Runs without a fix: nothing heard before the search ended, however it did, not over in time, or an estimate without a positive
    /// definite covariance.
    pub failed: u32,
    /// The root mean square of a bound on the error of any estimator, such as the posterior
    /// Cramér-Rao bound, at the end; where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound_m: Option<f64>,
    /// The root mean square error over the whole track, not only at its end; where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub track_rms_m: Option<f64>,
    /// The errors on the way, where the scenario asks for them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub checkpoints: Vec<Checkpoint>,
}

/// The errors after some of the measurements.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Checkpoint {
    /// After how many.
    pub measurements: u32,
    /// From the estimate to the truth; absent when every run failed, like what follows.
    pub error_m: Option<Spread>,
    /// The average normalised estimation error squared; 2 for a consistent estimator.
    pub anees: Option<f64>,
    /// The root mean square of a bound on the error of any estimator, where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound_m: Option<f64>,
}

/// What one run says of one beacon.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sample {
    pub(crate) error_m: f64,
    pub(crate) nees: f64,
    pub(crate) steps: u32,
    /// The normalised innovations squared with their degrees of freedom.
    pub(crate) nis: Vec<(f64, usize)>,
}

impl BeaconCampaign {
    /// The statistics of what the good ones of `total` runs say, without checkpoints and bounds,
    /// and without what is of flights alone.
    pub(crate) fn of(name: &str, good: &[Sample], total: u32) -> Self {
        let column = |value: fn(&Sample) -> f64| -> Vec<f64> { good.iter().map(value).collect() };
        let count = u32::try_from(good.len()).unwrap_or(u32::MAX);
        let (anees, mut anis) = (anees(good), ChiSquaredAverage::default());
        let mut coverage = Coverage::new(0.95, 0.95).expect("both are in (0, 1)");
        for sample in good {
            coverage.add_nees(sample.nees);
            anis.extend(sample.nis.iter().copied());
        }
        Self {
            name: name.to_owned(),
            error_m: Spread::of(&column(|sample| sample.error_m)),
            steps: StepSpread::of(&column(|sample| f64::from(sample.steps))),
            steps_to_3m: None,
            time_to_3m_s: None,
            path_m: None,
            anees: anees.average(),
            anees_interval: anees.interval(),
            verdict: anees.verdict(),
            coverage_95: coverage.share(),
            coverage_95_interval: coverage.interval(),
            anis: anis.average(),
            anis_interval: anis.interval(),
            failed: total - count,
            bound_m: None,
            track_rms_m: None,
            checkpoints: Vec::new(),
        }
    }
}

impl Checkpoint {
    /// The statistics of what the good runs say after so many measurements, without a bound.
    pub(crate) fn of(measurements: u32, good: &[Sample]) -> Self {
        let errors: Vec<f64> = good.iter().map(|sample| sample.error_m).collect();
        let (error_m, anees) = (Spread::of(&errors), anees(good).average());
        Self { measurements, error_m, anees, bound_m: None }
    }
}

fn anees(good: &[Sample]) -> ChiSquaredAverage {
    let mut anees = ChiSquaredAverage::default();
    anees.extend(good.iter().map(|sample| (sample.nees, 2)));
    anees
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
    let pool = threads(jobs)?;
    let estimators = estimators
        .iter()
        .map(|estimator| {
            let flown = fly_all(&pool, scenario, estimator, runs, seed, progress)?;
            Ok(summarise(scenario, estimator, &flown))
        })
        .collect::<Result<_, CampaignError>>()?;
    let planner = Some(OWN.to_owned());
    Ok(CampaignReport { scenario: scenario.name.clone(), planner, runs, seed, estimators })
}

/// So many threads.
pub(super) fn threads(jobs: usize) -> Result<ThreadPool, CampaignError> {
    ThreadPoolBuilder::new()
        .num_threads(jobs)
        .build()
        .map_err(|error| CampaignError::Threads { jobs, reason: error.to_string() })
}

/// Every run of one estimator, in the order of their seeds.
pub(super) fn fly_all(
    pool: &ThreadPool,
    scenario: &Scenario,
    estimator: &NamedEstimator,
    runs: u32,
    seed: u64,
    progress: &(dyn Fn() + Sync),
) -> Result<Vec<Run>, SimulationError> {
    let fly = |run: u32| {
        let outcome = fly(scenario, estimator, seed.wrapping_add(u64::from(run)));
        progress();
        outcome
    };
    pool.install(|| (0..runs).into_par_iter().map(fly).collect())
}

/// What one run came to.
#[derive(Clone, Debug, Default)]
pub(super) struct Run {
    /// How long it took, in simulated seconds; none for one that could not go on.
    pub(super) duration_s: Option<f64>,
    /// What it says of each beacon; none for one whose search did not end.
    beacons: Vec<Option<BeaconRun>>,
}

impl Run {
    /// What it says of a beacon, if that is good for a statistic.
    pub(super) fn sample(&self, beacon: usize) -> Option<Sample> {
        let BeaconRun { found, nis } = self.beacons.get(beacon)?.as_ref()?;
        let sample = Sample {
            error_m: found.error_m(),
            nees: found.nees()?,
            steps: found.fix.steps,
            nis: nis.clone(),
        };
        // Whatever the search ended with: without a reception the estimate is the prior.
        let heard = found.fix.steps > 0;
        (heard && sample.nees.is_finite() && sample.error_m.is_finite()).then_some(sample)
    }

    /// How the search for a beacon ended, if it did.
    pub(super) fn outcome(&self, beacon: usize) -> Option<Outcome> {
        Some(self.beacons.get(beacon)?.as_ref()?.found.fix.outcome)
    }

    /// How the search for a beacon came along, if it ended.
    pub(super) fn progress(&self, beacon: usize) -> Option<SearchProgress> {
        Some(self.beacons.get(beacon)?.as_ref()?.found.progress)
    }
}

/// What one run says of one beacon.
#[derive(Clone, Debug)]
struct BeaconRun {
    found: Found,
    /// Its normalised innovations squared with their degrees of freedom.
    nis: Vec<(f64, usize)>,
}

fn fly(scenario: &Scenario, estimator: &NamedEstimator, seed: u64) -> Result<Run, SimulationError> {
    let track = &estimator.config.track;
    let mut nis = vec![Vec::new(); scenario.world.beacons.len()];
    let (mut heard, mut components) = (0, 0);
    let flown = simulate(scenario, estimator, seed, |event| {
        match event {
            Event::Received { first_position, reception, .. } => {
                heard = usize::from(reception.beacon.0);
                components = track.degrees_of_freedom(reception, *first_position);
            }
            Event::Corrected { correction, .. } => {
                if let (Some(value), Some(beacon)) = (correction.nis(), nis.get_mut(heard)) {
                    beacon.push((value, components));
                }
            }
            _ => {}
        }
        Ok::<_, Infallible>(())
    });
    let (found, duration_s) = match flown {
        Ok(hunt) => (hunt.found, Some(hunt.duration_s)),
        // The hunt itself could not go on: a failed run. A scenario that cannot be built would
        // fail every run alike and is an error.
        Err(SimulationError::TooLong { .. } | SimulationError::Drive(_)) => (Vec::new(), None),
        Err(error) => return Err(error),
    };
    let mut beacons = vec![None; nis.len()];
    for found in found {
        let index = usize::from(found.fix.beacon.0);
        if let (Some(beacon), Some(nis)) = (beacons.get_mut(index), nis.get_mut(index)) {
            *beacon = Some(BeaconRun { found, nis: mem::take(nis) });
        }
    }
    Ok(Run { duration_s, beacons })
}

/// How long the runs took that came to an end.
pub(super) fn durations(runs: &[Run]) -> Option<Spread> {
    Spread::of(&runs.iter().filter_map(|run| run.duration_s).collect::<Vec<_>>())
}

/// The statistics of an estimator's runs.
pub(super) fn summarise(
    scenario: &Scenario,
    estimator: &NamedEstimator,
    runs: &[Run],
) -> EstimatorCampaign {
    let total = u32::try_from(runs.len()).unwrap_or(u32::MAX);
    let beacon = |(index, beacon): (usize, &foxhunt_sim::BeaconConfig)| {
        let good: Vec<Sample> = runs.iter().filter_map(|run| run.sample(index)).collect();
        let progress: Vec<_> = runs.iter().map(|run| run.progress(index)).collect();
        let steps = progress.iter().map(|run| run.and_then(|run| run.steps_to_3m).map(f64::from));
        let times = progress.iter().map(|run| run.and_then(|run| run.time_to_3m_s));
        let paths: Vec<f64> = progress.iter().flatten().map(|run| run.path_m).collect();
        BeaconCampaign {
            steps_to_3m: FirstPassage::of(steps),
            time_to_3m_s: FirstPassage::of(times),
            path_m: Spread::of(&paths),
            ..BeaconCampaign::of(&beacon.name, &good, total)
        }
    };
    let beacons = scenario.world.beacons.iter().enumerate().map(beacon).collect();
    EstimatorCampaign { estimator: estimator.name.to_owned(), beacons }
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
