//! Every planner that has a name, flown to its end.

use std::convert::Infallible;

use foxhunt::{
    campaign::{PlannedBeacon, PlannersReport, Repetition, planners_campaign},
    core::Outcome,
    registry::{PlannerEntry, Recipe, Registry},
    scenario::Scenario,
    simulation::{Setup, Simulated},
};

use crate::support::{entry, repetition};

/// The seed of each of these hunts; one hunt for each planner.
const SEED: u64 = 3;

fn fly(scenario: &Scenario) -> Simulated {
    let setup = Setup { scenario, estimator: &entry("grid"), registry: &Registry::builtin() };
    setup.simulate(SEED, |_| Ok::<_, Infallible>(())).expect("a hunt that ends")
}

/// A scenario with a planner of the registry.
fn with_planner(mut scenario: Scenario, planner: &PlannerEntry) -> Scenario {
    let Recipe::Settings(settings) = &planner.recipe else { panic!("the library's own") };
    scenario.planner = settings(&scenario.field());
    scenario
}

/// A campaign with the grid.
fn of_planners(
    scenario: &Scenario,
    planners: &[PlannerEntry],
    repetition: &Repetition<'_>,
) -> PlannersReport {
    planners_campaign(&Registry::builtin(), scenario, &entry("grid"), planners, repetition)
        .expect("the scenario is in order")
}

fn planner(name: &str) -> PlannerEntry {
    Registry::builtin().planner(name).expect("it is known").clone()
}

/// Every planner that moves finds both beacons within 6 m. An honest estimate whose 95 % ellipse
/// has a semi-major axis of 3 m, which planners are compared by, has a σ of 3 m / 2.448 a
/// coordinate at most, and misses by more with a probability of exp(-6² / 2 σ²) = 6e-6, or 2e-4
/// over all these searches. One hunt each: this finds a broken planner, not a poor one.
#[test]
fn each_finds_the_beacons_of_the_references_simulation() {
    for planner in Registry::builtin().planners() {
        let scenario = Scenario::find("pritzl-6.1").expect("a built-in scenario");
        let hunt = fly(&with_planner(scenario, planner));
        let outcomes: &[Outcome] = match &*planner.name {
            "waypoints" | "lawn-mower" => &[Outcome::PathDone],
            "hold" => &[Outcome::MoveLimit],
            "information" | "detection" => &[Outcome::EllipseReached, Outcome::LittleToLearn],
            _ => &[Outcome::Converged, Outcome::EllipseReached, Outcome::MoveLimit],
        };
        assert_eq!(hunt.found.len(), 2, "{}", planner.name);
        for found in &hunt.found {
            let name = &planner.name;
            let fix = &found.fix;
            let miss = found.error_m();
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
        let hunt = fly(&with_planner(scenario, &planner(name)));
        assert_eq!(hunt.found.len(), 2, "{name}");
        for found in &hunt.found {
            let fix = &found.fix;
            let miss = found.error_m();
            assert_eq!(fix.outcome, Outcome::Converged, "{name}");
            assert!(miss < 10.0, "{name} misses {} by {miss} m", fix.name);
        }
    }
}

/// Twenty hunts with each, seeds from 500: the information-driven planner needs at most 80 % of the
/// reference's steps to an ellipse of 3 m, run by run in the geometric mean. The campaigns of 500
/// give 65 to 70 %, and single runs differ by a fifth, so that the mean of twenty is off by a
/// twentieth: three standard errors, false alarms below 1 %.
#[test]
fn information_needs_fewer_steps_than_the_reference() {
    let scenario = Scenario::find("pritzl-6.1").expect("a built-in scenario");
    let planners = ["pritzl2018", "information"].map(planner);
    let report = of_planners(&scenario, &planners, &repetition(20, 500));
    for comparison in &report.comparisons {
        let ratio = comparison.steps_to_3m.as_ref().expect("they all get there").ratio;
        assert!(ratio < 0.8, "{}: {ratio}", comparison.beacon);
    }
    // It stops earlier, and no worse: the ratio of two mean squares of twenty errors each is
    // below Snedecor's F(20, 20) at 99.5 % where both are alike, even if errors are all along one
    // line; false alarms at most 1 % over two beacons.
    const F_20_20_995: f64 = 3.3178;
    let [reference, information] = &report.planners[..] else { panic!("two planners") };
    for (own, other) in information.beacons.iter().zip(&reference.beacons) {
        let rms = |beacon: &PlannedBeacon| beacon.figures.error_m.expect("they all end").rms;
        let (own, other, name) = (rms(own), rms(other), &own.figures.name);
        assert!(own < other * F_20_20_995.sqrt(), "{name}: {own} m against {other} m");
    }
}

/// Purpose of the planner, in 500 hunts with seeds from 1: its median number of steps to an ellipse
/// of 3 m is at most 75 % of the reference's near the beacon, its median time at most 80 % far from
/// it, and its estimates are as good as claimed: the ANEES is not above its 95 % interval, which an
/// honest one's is once in forty.
#[test]
#[ignore = "campaign: two thousand hunts, minutes in release"]
fn information_is_faster_than_the_reference_in_full() {
    let planners = ["pritzl2018", "information"].map(planner);
    for (name, most_share) in [("pritzl-6.1", 0.75), ("far-start", 0.8)] {
        let scenario = Scenario::find(name).expect("a built-in scenario");
        let report = of_planners(&scenario, &planners, &repetition(500, 1));
        let [reference, information] = &report.planners[..] else { panic!("two planners") };
        for (own, other) in information.beacons.iter().zip(&reference.beacons) {
            let median = |beacon: &PlannedBeacon| {
                let figures = &beacon.figures;
                let far = name == "far-start";
                let passage = if far { figures.time_to_3m_s } else { figures.steps_to_3m };
                passage.and_then(|passage| passage.p50).expect("more than half get there")
            };
            let share = median(own) / median(other);
            assert!(share <= most_share, "{name}, {}: {share}", own.figures.name);
            let [_, high] = own.figures.anees_interval.expect("there are runs");
            let anees = own.figures.anees.expect("there are runs");
            assert!(anees <= high, "{name}, {}: ANEES {anees} above {high}", own.figures.name);
        }
    }
}
