//! Every planner that has a name, flown to its end.

use std::convert::Infallible;

use foxhunt::{
    campaign::planners_campaign,
    config::{estimator_named, planner_named, planners},
    core::Outcome,
    scenario::Scenario,
    simulation::{Simulated, simulate},
};

/// The seed of each of these hunts; one hunt for each planner.
const SEED: u64 = 3;

fn fly(scenario: &Scenario) -> Simulated {
    let grid = estimator_named("grid").expect("it is known");
    simulate(scenario, &grid, SEED, |_| Ok::<_, Infallible>(())).expect("a hunt that ends")
}

/// Whoever moves finds both beacons within 6 m, four times the rms error of the reference planner with
/// this estimator; one hunt each, so this tells a planner that is broken, not one that is poor.
#[test]
fn each_finds_the_beacons_of_the_references_simulation() {
    for planner in planners() {
        let mut scenario = Scenario::find("pritzl-6.1").expect("a built-in scenario");
        scenario.planner = planner.config(&scenario);
        let hunt = fly(&scenario);
        let outcomes: &[Outcome] = match planner.name {
            "waypoints" | "lawn-mower" => &[Outcome::PathDone],
            "hold" => &[Outcome::MoveLimit],
            "information" => &[Outcome::EllipseReached, Outcome::LittleToLearn],
            _ => &[Outcome::Converged, Outcome::EllipseReached, Outcome::MoveLimit],
        };
        assert_eq!(hunt.found.len(), 2, "{}", planner.name);
        for found in &hunt.found {
            let (name, fix, miss) = (planner.name, &found.fix, found.error_m());
            let outcome = fix.outcome;
            assert!(outcomes.contains(&outcome), "{name}: {outcome}");
            let far = if name == "hold" { 15.0 } else { 6.0 };
            assert!(miss < far, "{name} misses {} by {miss} m", fix.name);
        }
    }
}

/// One drone alone finds them as well, with the planners that search.
#[test]
fn one_drone_is_enough_for_those_that_move() {
    for name in ["pritzl2018", "pritzl2018-emulated", "orbit", "arcs", "surge-cast"] {
        let mut scenario = Scenario::find("pritzl-6.1").expect("a built-in scenario");
        scenario.world.drones.truncate(1);
        scenario.planner = planner_named(name).expect("it is known").config(&scenario);
        let hunt = fly(&scenario);
        assert_eq!(hunt.found.len(), 2, "{name}");
        for found in &hunt.found {
            let (fix, miss) = (&found.fix, found.error_m());
            assert_eq!(fix.outcome, Outcome::Converged, "{name}");
            assert!(miss < 10.0, "{name} misses {} by {miss} m", fix.name);
        }
    }
}

/// Twenty hunts with each, seeds from 500: the information-driven planner needs at most 80 % of the
/// reference's steps to an ellipse of 3 m, run by run in the geometric mean. The campaigns of 500
/// say 65 to 70 %, and single runs differ by a fifth, so that the mean of twenty is off by a
/// twentieth: three standard errors, false alarms below 1 %.
#[test]
fn information_needs_fewer_steps_than_the_reference() {
    let scenario = Scenario::find("pritzl-6.1").expect("a built-in scenario");
    let grid = estimator_named("grid").expect("it is known");
    let planners = ["pritzl2018", "information"].map(|n| planner_named(n).expect("it is known"));
    let report = planners_campaign(&scenario, &grid, &planners, 20, 500, 2, &|| ());
    let report = report.expect("the scenario is in order");
    for comparison in &report.comparisons {
        let ratio = comparison.steps_to_3m.as_ref().expect("they all get there").ratio;
        assert!(ratio < 0.8, "{}: {ratio}", comparison.beacon);
    }
    // It stops earlier, and no worse: the reference's rms here is 1.1 m.
    for beacon in &report.planners[1].beacons {
        let rms = beacon.figures.error_m.expect("they all end").rms;
        assert!(rms < 1.4, "{}: {rms} m", beacon.figures.name);
    }
}
