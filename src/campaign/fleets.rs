use std::convert::Infallible;

use foxhunt_core::Outcome;
use rayon::prelude::*;
use serde::Serialize;

use super::{
    CampaignError, OutcomeCount, Spread, Violation,
    fleet_watch::{FleetWatch, Seen},
    run::threads,
};
use crate::{
    config::{NamedEstimator, NamedPlanner, estimator_named},
    hunt::DriveError,
    scenario::{Scenario, random_fleet},
    simulation::{SimulationError, simulate_watched},
};

/// What random fleets came to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FleetsReport {
    /// How many hunts were flown.
    pub runs: u32,
    /// The seed of the first one; run i has this plus i.
    pub seed: u64,
    /// How the searches ended, the most frequent end first.
    pub outcomes: Vec<OutcomeCount>,
    /// Why hunts could not begin or go on, the most frequent reason first.
    pub errors: Vec<ErrorCount>,
    /// How long a hunt took, in simulated seconds; absent where none came to an end.
    pub duration_s: Option<Spread>,
    /// The least distance of two drones over ground beyond their separation, in metres; absent
    /// where there were no two.
    pub spare_separation_m: Option<f64>,
    /// The least distance of a drone inside its fence and outside the zones to keep out of, in
    /// metres; absent where there was neither.
    pub spare_airspace_m: Option<f64>,
    /// The least time that a drone's batteries had left in the air, in seconds; absent where none
    /// had batteries.
    pub spare_endurance_s: Option<f64>,
    /// Drones that stayed in the air because they were stuck or could not be reached when they had
    /// to fly home. No hunt could have brought them back, so they are no violation.
    pub stranded: u32,
    /// What must not happen and did, by seed.
    pub violations: Vec<Violation>,
}

/// In how many hunts something was the reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ErrorCount {
    /// What.
    pub reason: String,
    /// In how many.
    pub runs: u32,
}

/// What one hunt came to.
struct FleetRun {
    outcomes: Vec<Outcome>,
    error: Option<String>,
    duration_s: Option<f64>,
    seen: Seen,
}

/// Flies `runs` hunts, each with a [`random_fleet`], on `jobs` threads, and holds where the drones
/// truly are at every tick against what they must keep: their separation, the fence, the zones to
/// keep out of, the band of altitudes and the batteries; and every hunt has to end with a fix or a
/// reason. Run i has the seed `seed` + i for the scenario and its world; the result does not depend
/// on `jobs`. `planner` and `estimator` are those of the random scenarios where absent. `progress`
/// is called after each hunt, from any thread.
///
/// # Errors
///
/// [`CampaignError`] when a hunt cannot be built.
pub fn fleets_campaign(
    planner: Option<&NamedPlanner>,
    estimator: Option<&NamedEstimator>,
    runs: u32,
    seed: u64,
    jobs: usize,
    progress: &(dyn Fn() + Sync),
) -> Result<FleetsReport, CampaignError> {
    let pool = threads(jobs)?;
    let one = |run: u32| {
        let seed = seed.wrapping_add(u64::from(run));
        let mut scenario = random_fleet(seed);
        if let Some(planner) = planner {
            scenario.planner = planner.config(&scenario);
        }
        let flown = fly(&scenario, estimator, seed);
        progress();
        flown
    };
    let flown: Vec<FleetRun> =
        pool.install(|| (0..runs).into_par_iter().map(one).collect::<Result<_, _>>())?;
    let durations: Vec<f64> = flown.iter().filter_map(|run| run.duration_s).collect();
    let least = |spare: fn(&Seen) -> f64| {
        let least = flown.iter().map(|run| spare(&run.seen)).fold(f64::INFINITY, f64::min);
        Some(least).filter(|least| least.is_finite())
    };
    Ok(FleetsReport {
        runs,
        seed,
        outcomes: OutcomeCount::of(flown.iter().flat_map(|run| run.outcomes.iter().copied())),
        errors: errors(&flown),
        duration_s: Spread::of(&durations),
        spare_separation_m: least(|seen| seen.spare_separation_m),
        spare_airspace_m: least(|seen| seen.spare_airspace_m),
        spare_endurance_s: least(|seen| seen.spare_endurance_s),
        stranded: flown.iter().map(|run| run.seen.stranded).sum(),
        violations: flown.iter().flat_map(|run| run.seen.violations.iter().cloned()).collect(),
    })
}

fn errors(flown: &[FleetRun]) -> Vec<ErrorCount> {
    let mut counts: Vec<ErrorCount> = Vec::new();
    for reason in flown.iter().filter_map(|run| run.error.as_ref()) {
        match counts.iter_mut().find(|count| count.reason == *reason) {
            Some(count) => count.runs += 1,
            None => counts.push(ErrorCount { reason: reason.clone(), runs: 1 }),
        }
    }
    counts.sort_by_key(|count| std::cmp::Reverse(count.runs));
    counts
}

fn fly(
    scenario: &Scenario,
    estimator: Option<&NamedEstimator>,
    seed: u64,
) -> Result<FleetRun, SimulationError> {
    let own = estimator_named(&scenario.estimator).expect("a random fleet names a known one");
    let watch = FleetWatch::new(scenario, seed).map_err(|error| DriveError::Hunt(error.into()))?;
    let watch = std::cell::RefCell::new(watch);
    let flown = simulate_watched(
        scenario,
        estimator.unwrap_or(&own),
        seed,
        |event| {
            watch.borrow_mut().note(event);
            Ok::<_, Infallible>(())
        },
        |world| watch.borrow_mut().look(world),
    );
    let watch = watch.into_inner();
    match flown {
        Ok(hunt) => {
            let outcomes: Vec<Outcome> = hunt.found.iter().map(|f| f.fix.outcome).collect();
            let silent = outcomes.len() < scenario.world.beacons.len();
            let (error, duration_s) = (None, Some(hunt.duration_s));
            Ok(FleetRun { outcomes, error, duration_s, seen: watch.end(hunt.duration_s, silent) })
        }
        Err(SimulationError::TooLong { limit_s }) => {
            let (outcomes, error, duration_s) = (Vec::new(), None, None);
            Ok(FleetRun { outcomes, error, duration_s, seen: watch.end(limit_s, true) })
        }
        Err(SimulationError::Drive(error)) => {
            let (outcomes, error, duration_s) = (Vec::new(), Some(error.to_string()), None);
            Ok(FleetRun { outcomes, error, duration_s, seen: watch.seen })
        }
        Err(error) => Err(error),
    }
}
