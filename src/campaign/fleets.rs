use std::{cell::RefCell, convert::Infallible};

use foxhunt_core::Outcome;
use rayon::prelude::*;
use serde::Serialize;

use super::{
    CampaignError, OWN, OutcomeCount, Spread, Violation,
    fleet_watch::{FleetWatch, Seen},
    run::threads,
};
use crate::{
    config::{NamedEstimator, NamedPlanner, estimator_named},
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
    /// The planner, or [`OWN`].
    pub planner: String,
    /// The estimator, or [`OWN`].
    pub estimator: String,
    /// How the searches ended, the most frequent end first.
    pub outcomes: Vec<OutcomeCount>,
    /// The hunts that could not begin or go on, and why.
    pub errors: Vec<FailedRun>,
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

/// A hunt that could not begin or go on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FailedRun {
    /// The seed of the hunt: `fleet-` and this is its scenario.
    pub seed: u64,
    /// Why.
    pub reason: String,
}

/// What one hunt came to.
struct FleetRun {
    outcomes: Vec<Outcome>,
    error: Option<FailedRun>,
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
/// [`CampaignError`] when the threads cannot be started. A hunt that cannot begin or go on is one of
/// [`FleetsReport::errors`], and the others are flown.
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
    let flown: Vec<FleetRun> = pool.install(|| (0..runs).into_par_iter().map(one).collect());
    let durations: Vec<f64> = flown.iter().filter_map(|run| run.duration_s).collect();
    let least = |spare: fn(&Seen) -> f64| {
        let least = flown.iter().map(|run| spare(&run.seen)).fold(f64::INFINITY, f64::min);
        Some(least).filter(|least| least.is_finite())
    };
    Ok(FleetsReport {
        runs,
        seed,
        planner: planner.map_or(OWN, |planner| planner.name).to_owned(),
        estimator: estimator.map_or(OWN, |estimator| estimator.name).to_owned(),
        outcomes: OutcomeCount::of(flown.iter().flat_map(|run| run.outcomes.iter().copied())),
        errors: flown.iter().filter_map(|run| run.error.clone()).collect(),
        duration_s: Spread::of(&durations),
        spare_separation_m: least(|seen| seen.spare_separation_m),
        spare_airspace_m: least(|seen| seen.spare_airspace_m),
        spare_endurance_s: least(|seen| seen.spare_endurance_s),
        stranded: flown.iter().map(|run| run.seen.stranded).sum(),
        violations: flown.iter().flat_map(|run| run.seen.violations.iter().cloned()).collect(),
    })
}

fn fly(scenario: &Scenario, estimator: Option<&NamedEstimator>, seed: u64) -> FleetRun {
    let own = estimator_named(&scenario.estimator).expect("a random fleet names a known one");
    let failed = |reason: String| Some(FailedRun { seed, reason });
    let watch = match FleetWatch::new(scenario, seed) {
        Ok(watch) => RefCell::new(watch),
        Err(error) => {
            let (error, seen) = (failed(error.to_string()), Seen::default());
            return FleetRun { outcomes: Vec::new(), error, duration_s: None, seen };
        }
    };
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
            // A beacon that appears when the search is over is nobody's.
            let there = |appears: f64| appears + scenario.simulation.tick_s < watch.found_last_s();
            let beacons = &scenario.world.beacons;
            let owed = beacons.iter().filter(|b| b.appears_after_s.is_none_or(there)).count();
            let silent = outcomes.len() < owed;
            let (error, duration_s) = (None, Some(hunt.duration_s));
            FleetRun { outcomes, error, duration_s, seen: watch.end(hunt.duration_s, silent) }
        }
        Err(SimulationError::TooLong { limit_s }) => {
            let (outcomes, error, duration_s) = (Vec::new(), None, None);
            FleetRun { outcomes, error, duration_s, seen: watch.end(limit_s, true) }
        }
        Err(error) => {
            // Who was in the air then is held against the rules all the same.
            let (error, at) = (failed(error.to_string()), watch.looked_at_s());
            FleetRun { outcomes: Vec::new(), error, duration_s: None, seen: watch.end(at, false) }
        }
    }
}
