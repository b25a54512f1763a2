//! Seeded Monte Carlo: the same scenario many times, and the statistics of each contender.

mod comparisons;
mod fleets;
mod report;
mod sigmas;

pub use comparisons::{
    AntennaComparison, AntennaSetup, AntennasReport, OutcomeCount, PLANNER_SCENARIOS,
    PlannedBeacon, PlannerCampaign, PlannerComparison, PlannersReport, SetupCampaign,
    antennas_campaign, planners_campaign,
};
pub use fleets::{Breach, FailedRun, FleetsReport, Violation, fleets_campaign};
pub use report::{
    BeaconCampaign, BeaconRun, CampaignReport, Checkpoint, EstimatorCampaign, OWN,
    TransmittersCampaign,
};
pub use sigmas::{
    BearingStatistics, SigmaCampaign, SigmaComparison, SigmaSetup, SigmasCampaign, SigmasReport,
    sigmas_campaign,
};

pub(crate) use fleets::FleetRun;
pub(crate) use report::{BeaconSummary, FlightsSummary, Sample};

use std::convert::Infallible;

use foxhunt_core::Outcome;
use foxhunt_hunt::{
    registry::{EstimatorEntry, Registry},
    scenario::Scenario,
};

use crate::{
    Experiment, Runner, Spread, ThreadsError,
    report::HuntReport,
    simulation::{Found, SearchProgress, Setup, Simulated, SimulationError},
};

/// Hunts that are flown by `fly`, one for each seed.
///
/// A hunt that could not go on is a failed run; a setup that cannot be built would fail every run
/// alike and is an error.
#[derive(Clone, Copy, Debug)]
struct Flights<F>(F);

impl<F> Experiment for Flights<F>
where
    F: Fn(u64) -> Result<Simulated, SimulationError> + Sync,
{
    type Run = Flown;
    type Error = SimulationError;

    fn run(&self, seed: u64) -> Result<Flown, SimulationError> {
        Flown::of((self.0)(seed))
    }
}

/// The result of one hunt, or why it could not go on.
#[derive(Clone, Debug)]
pub(crate) struct Flown(pub Result<Simulated, String>);

impl Flown {
    /// A flight; an error where it could not begin.
    pub(crate) fn of(flown: Result<Simulated, SimulationError>) -> Result<Self, SimulationError> {
        match flown {
            Ok(hunt) => Ok(Self(Ok(hunt))),
            Err(error @ (SimulationError::TooLong { .. } | SimulationError::Drive(_))) => {
                Ok(Self(Err(error.to_string())))
            }
            Err(error) => Err(error),
        }
    }

    fn found(&self, beacon: usize) -> Option<&Found> {
        let found = &self.0.as_ref().ok()?.found;
        found.iter().find(|found| usize::from(found.fix.beacon.0) == beacon)
    }

    /// The figures of a beacon's search.
    pub(crate) fn beacon_run(&self, beacon: usize) -> BeaconRun {
        self.found(beacon).map_or_else(BeaconRun::default, BeaconRun::of)
    }

    /// The figures of a beacon, if they are good for a statistic.
    fn sample(&self, beacon: usize) -> Option<Sample> {
        self.beacon_run(beacon).sample()
    }

    /// The end of the search for a beacon, if it ended.
    fn outcome(&self, beacon: usize) -> Option<Outcome> {
        Some(self.found(beacon)?.fix.outcome)
    }

    /// The progress of the search for a beacon, if it ended.
    fn progress(&self, beacon: usize) -> Option<SearchProgress> {
        Some(self.found(beacon)?.progress)
    }
}

/// The repetition of a campaign: the number of runs, the first seed and the number of threads.
#[derive(Clone, Copy)]
pub struct Repetition<'a> {
    /// The number of runs of each contender.
    pub runs: u32,
    /// The seed of the first run; run i has this plus i, for every contender the same.
    pub seed: u64,
    /// The number of threads.
    pub jobs: usize,
    /// Called after each run, from any thread.
    pub progress: &'a (dyn Fn() + Sync),
}

impl std::fmt::Debug for Repetition<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { runs, seed, jobs, .. } = self;
        f.debug_struct("Repetition")
            .field("runs", runs)
            .field("seed", seed)
            .field("jobs", jobs)
            .finish_non_exhaustive()
    }
}

impl Repetition<'_> {
    /// The repetition of `runs` runs from the seed 1 on, on all processors, without progress.
    #[must_use]
    pub fn new(runs: u32) -> Self {
        let jobs = std::thread::available_parallelism().map_or(1, Into::into);
        Self { runs, seed: 1, jobs, progress: &|| () }
    }

    /// Runs an experiment and keeps its runs.
    pub(crate) fn of<E: Experiment>(
        &self,
        runner: &Runner,
        experiment: &E,
    ) -> Result<Vec<E::Run>, E::Error> {
        runner.run(experiment, self.runs, self.seed, self.progress)
    }

    /// Flies hunts and keeps their statistics alone; `take` is given the hunts that ended.
    fn fly<F: Fn(u64) -> Result<Simulated, SimulationError> + Sync>(
        &self,
        runner: &Runner,
        flights: &Flights<F>,
        name: &str,
        beacons: &[String],
        mut take: impl FnMut(u64, &Simulated) -> Result<(), SimulationError>,
    ) -> Result<EstimatorCampaign, SimulationError> {
        let mut summary = FlightsSummary::new(beacons);
        runner.run_each(flights, self.runs, self.seed, self.progress, |seed, run| {
            summary.add(|beacon| run.beacon_run(beacon));
            run.0.as_ref().map_or(Ok(()), |hunt| take(seed, hunt))
        })?;
        Ok(summary.report(name))
    }
}

/// The reason why there is no campaign.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CampaignError {
    /// The threads could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
    /// A hunt could not be built.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
}

/// The spread of the durations of the hunts that ended.
fn durations(runs: &[Flown]) -> Option<Spread> {
    let durations = runs.iter().filter_map(|run| Some(run.0.as_ref().ok()?.duration_s));
    Spread::of(&durations.collect::<Vec<_>>())
}

/// The statistics of one contender's hunts for these beacons.
fn summarise(name: &str, beacons: &[String], runs: &[Flown]) -> EstimatorCampaign {
    let mut summary = FlightsSummary::new(beacons);
    runs.iter().for_each(|run| summary.add(|beacon| run.beacon_run(beacon)));
    summary.report(name)
}

/// Returns the names of all beacons of a scenario, also of beacons that appear later.
pub(crate) fn beacon_names(scenario: &Scenario) -> Vec<String> {
    scenario.world.beacons.iter().map(|beacon| beacon.name.clone()).collect()
}

/// Flies a scenario with each estimator. The result does not depend on the number of threads, and
/// the memory that it takes not on the number of runs.
///
/// # Errors
///
/// [`CampaignError`] when the scenario or an estimator cannot be built. A single run that goes
/// wrong is counted in [`BeaconCampaign::failed`].
pub fn campaign(
    registry: &Registry,
    scenario: &Scenario,
    estimators: &[EstimatorEntry],
    repetition: &Repetition<'_>,
) -> Result<CampaignReport, CampaignError> {
    campaign_watched(registry, scenario, estimators, repetition, |_| Ok::<_, Infallible>(()))
}

/// Flies a [`campaign`] and hands the report of each hunt to `on_hunt`, estimator by estimator in
/// the order of the seeds; hunts that could not go on are left out.
///
/// # Errors
///
/// The errors of [`campaign`]; whatever `on_hunt` returns ends it, too.
pub fn campaign_watched<O: std::error::Error + Send + Sync + 'static>(
    registry: &Registry,
    scenario: &Scenario,
    estimators: &[EstimatorEntry],
    repetition: &Repetition<'_>,
    mut on_hunt: impl FnMut(&HuntReport) -> Result<(), O>,
) -> Result<CampaignReport, CampaignError> {
    let runner = Runner::new(repetition.jobs)?;
    let beacons = beacon_names(scenario);
    let estimators = estimators
        .iter()
        .map(|estimator| {
            let setup = Setup { scenario, estimator, registry };
            let flights = Flights(|seed| simulate(&setup, seed));
            let name = &estimator.name;
            Ok(repetition.fly(&runner, &flights, name, &beacons, |seed, hunt| {
                on_hunt(&HuntReport::new(seed, name, OWN, hunt))
                    .map_err(|error| SimulationError::Log(Box::new(error)))
            })?)
        })
        .collect::<Result<_, CampaignError>>()?;
    Ok(CampaignReport {
        scenario: scenario.name.clone(),
        planner: Some(OWN.to_owned()),
        runs: repetition.runs,
        seed: repetition.seed,
        estimators,
    })
}

/// Flies hunts of any parts: `fly` makes the world, the hunt and the drones of a seed and flies
/// them, as with [`simulation::fly`](crate::simulation::fly). `name` is what the report calls them,
/// and `beacons` are the beacons' names, in their order.
///
/// # Errors
///
/// [`CampaignError`] when a run cannot be built. A single run that goes wrong is counted in
/// [`BeaconCampaign::failed`].
pub fn campaign_with(
    name: &str,
    beacons: &[String],
    repetition: &Repetition<'_>,
    fly: impl Fn(u64) -> Result<Simulated, SimulationError> + Sync,
) -> Result<CampaignReport, CampaignError> {
    let runner = Runner::new(repetition.jobs)?;
    let summary = repetition.fly(&runner, &Flights(fly), name, beacons, |_, _| Ok(()))?;
    Ok(CampaignReport {
        scenario: name.to_owned(),
        planner: None,
        runs: repetition.runs,
        seed: repetition.seed,
        estimators: vec![summary],
    })
}

fn simulate(setup: &Setup<'_>, seed: u64) -> Result<Simulated, SimulationError> {
    setup.simulate(seed, |_| Ok::<_, Infallible>(()))
}
