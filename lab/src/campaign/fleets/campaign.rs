//! Flights of random fleets, and what is found of them.

use std::{cell::RefCell, convert::Infallible};

use foxhunt_core::Outcome;
use foxhunt_hunt::{
    hunt::Event,
    registry::{EstimatorEntry, PlannerEntry, Registry},
    scenario::{Scenario, random_fleet},
};
use serde::Serialize;

use super::super::{CampaignError, OWN, OutcomeCount, Repetition};
use super::{FleetFindings, FleetWatch, Violation};
use crate::{
    Experiment, Runner, Spread,
    simulation::{Setup, SimulationError},
};

/// The results of random fleets.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FleetsReport {
    /// The number of hunts that were flown.
    pub runs: u32,
    /// The seed of the first one; run i has this plus i.
    pub seed: u64,
    /// The planner, or [`OWN`].
    pub planner: String,
    /// The estimator, or [`OWN`].
    pub estimator: String,
    /// The ends of the searches, the most frequent first.
    pub outcomes: Vec<OutcomeCount>,
    /// The hunts that could not begin or go on, and why.
    pub errors: Vec<FailedRun>,
    /// The duration of a hunt, in simulated seconds; absent if no hunt ended.
    pub duration_s: Option<Spread>,
    /// The least distance of two drones over ground beyond their separation, in metres; absent
    /// where there were no two.
    pub spare_separation_m: Option<f64>,
    /// The least distance of a drone inside its fence and outside the zones to keep out of, in
    /// metres; absent where there was neither.
    pub spare_airspace_m: Option<f64>,
    /// The least time that a drone's batteries had left in the air, in seconds; absent without
    /// batteries.
    pub spare_endurance_s: Option<f64>,
    /// Drones that stayed in the air because they were stuck or could not be reached when they had
    /// to fly home. No hunt could have brought them back, so they are no violation.
    pub stranded: u32,
    /// The events that must not happen and did, by seed.
    pub violations: Vec<Violation>,
}

/// A hunt that could not begin or go on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FailedRun {
    /// The seed of the hunt: `fleet-` and this is its scenario.
    pub seed: u64,
    /// The reason.
    pub reason: String,
}

/// The result of one hunt.
#[derive(Debug)]
pub(crate) struct FleetRun {
    pub outcomes: Vec<Outcome>,
    pub error: Option<FailedRun>,
    duration_s: Option<f64>,
    findings: FleetFindings,
}

/// Flies hunts, each with a [`random_fleet`], and holds the true places of the drones at every tick
/// against what they must keep: their separation, the fence, the zones to keep out of, the band of
/// altitudes and the batteries; and every hunt has to end with a fix or a reason. Scenario and
/// world have the seed of the run. Where `planner` or `estimator` is absent, the random scenarios'
/// own is taken.
///
/// # Errors
///
/// [`CampaignError`] when the threads cannot be started. A hunt that cannot begin or go on is one
/// of [`FleetsReport::errors`], and the others are flown.
pub fn fleets_campaign(
    registry: &Registry,
    planner: Option<&PlannerEntry>,
    estimator: Option<&EstimatorEntry>,
    repetition: &Repetition<'_>,
) -> Result<FleetsReport, CampaignError> {
    let runner = Runner::new(repetition.jobs)?;
    let fleets = Fleets { registry, planner, estimator };
    let flown = repetition.of(&runner, &fleets).unwrap_or_else(|never| match never {});
    let durations: Vec<f64> = flown.iter().filter_map(|run| run.duration_s).collect();
    let least = |spare: fn(&FleetFindings) -> f64| {
        let least = flown.iter().map(|run| spare(&run.findings)).fold(f64::INFINITY, f64::min);
        Some(least).filter(|least| least.is_finite())
    };
    Ok(FleetsReport {
        runs: repetition.runs,
        seed: repetition.seed,
        planner: planner.map_or(OWN, |planner| &planner.name).to_owned(),
        estimator: estimator.map_or(OWN, |estimator| &estimator.name).to_owned(),
        outcomes: OutcomeCount::of(flown.iter().flat_map(|run| run.outcomes.iter().copied())),
        errors: flown.iter().filter_map(|run| run.error.clone()).collect(),
        duration_s: Spread::of(&durations),
        spare_separation_m: least(|findings| findings.spare_separation_m),
        spare_airspace_m: least(|findings| findings.spare_airspace_m),
        spare_endurance_s: least(|findings| findings.spare_endurance_s),
        stranded: flown.iter().map(|run| run.findings.stranded).sum(),
        violations: flown.iter().flat_map(|run| run.findings.violations.iter().cloned()).collect(),
    })
}

/// Hunts with random fleets.
#[derive(Debug)]
struct Fleets<'a> {
    registry: &'a Registry,
    planner: Option<&'a PlannerEntry>,
    estimator: Option<&'a EstimatorEntry>,
}

impl Experiment for Fleets<'_> {
    type Run = FleetRun;
    type Error = Infallible;

    fn run(&self, seed: u64) -> Result<FleetRun, Infallible> {
        let mut scenario = random_fleet(seed);
        if let Some(planner) = self.planner {
            scenario.planner = planner.config(&scenario.field());
        }
        Ok(self.fly(&scenario, seed))
    }
}

impl Fleets<'_> {
    fn fly(&self, scenario: &Scenario, seed: u64) -> FleetRun {
        let own = self.registry.estimator(&scenario.estimator);
        let estimator = match (self.estimator, own) {
            (Some(estimator), _) | (None, Ok(estimator)) => estimator,
            (None, Err(error)) => return FleetRun::failed(seed, error.to_string()),
        };
        let setup = Setup { scenario, estimator, registry: self.registry };
        FleetRun::fly(&setup, seed, |_| ())
    }
}

impl FleetRun {
    /// The events that must not have happened and did.
    pub(crate) fn violations(&self) -> &[Violation] {
        &self.findings.violations
    }

    fn failed(seed: u64, reason: String) -> Self {
        Self {
            outcomes: Vec::new(),
            error: Some(FailedRun { seed, reason }),
            duration_s: None,
            findings: FleetFindings::default(),
        }
    }

    /// Flies a hunt, holds its drones against what they must keep, and calls `on_event` with each
    /// event.
    pub(crate) fn fly(setup: &Setup<'_>, seed: u64, mut on_event: impl FnMut(&Event)) -> Self {
        let scenario = setup.scenario;
        let watch = match FleetWatch::new(scenario, seed) {
            Ok(watch) => RefCell::new(watch),
            Err(error) => return Self::failed(seed, error.to_string()),
        };
        let flown = setup.simulate_watched(
            seed,
            |event| {
                watch.borrow_mut().note(event);
                on_event(event);
                Ok::<_, Infallible>(())
            },
            |world| watch.borrow_mut().look(world),
        );
        let watch = watch.into_inner();
        match flown {
            Ok(hunt) => {
                let outcomes: Vec<Outcome> = hunt.found.iter().map(|f| f.fix.outcome).collect();
                // A beacon that appears when the search is over is nobody's.
                let appears_in_time =
                    |appears: f64| appears + scenario.simulation.tick_s < watch.found_last_s();
                let beacons = &scenario.world.beacons;
                let owed = beacons.iter().filter(|b| b.appears_after_s.is_none_or(appears_in_time));
                let silent = outcomes.len() < owed.count();
                Self {
                    outcomes,
                    error: None,
                    duration_s: Some(hunt.duration_s),
                    findings: watch.end(hunt.duration_s, silent),
                }
            }
            Err(SimulationError::TooLong { limit_s }) => Self {
                outcomes: Vec::new(),
                error: None,
                duration_s: None,
                findings: watch.end(limit_s, true),
            },
            Err(error) => {
                // Who was in the air then is held against the rules all the same.
                let at = watch.looked_at_s();
                Self { findings: watch.end(at, false), ..Self::failed(seed, error.to_string()) }
            }
        }
    }
}
