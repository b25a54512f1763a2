//! Fleets in which everything is random that may go wrong.

use foxhunt::{
    campaign::{FleetsReport, OWN, Repetition, fleets_campaign},
    config::PlannerConfig,
    registry::Registry,
    scenario::{Scenario, random_fleet},
};

use crate::support::repetition;

fn fly(repetition: &Repetition<'_>) -> FleetsReport {
    fleets_campaign(&Registry::builtin(), None, None, repetition).expect("they can be built")
}

fn assert_safe(report: &FleetsReport) {
    assert_eq!(report.errors, [], "every hunt comes to an end");
    assert_eq!(report.violations, [], "`foxhunt hunt fleet-SEED --seed SEED` flies one again");
    assert!(report.spare_separation_m.expect("there are pairs") >= 0.0);
    assert!(report.spare_airspace_m.expect("there are fences") >= 0.0);
    assert!(report.spare_endurance_s.expect("there are batteries") >= 0.0);
}

#[test]
fn sixty_random_fleets_keep_what_they_must() {
    let report = fly(&repetition(60, 1));
    assert_safe(&report);
    // What may go wrong does, and hunts end in more than one way.
    assert!(report.outcomes.len() >= 4, "{:?}", report.outcomes);
}

#[test]
fn a_fleet_is_that_of_its_seed_on_any_number_of_threads() {
    let report = fly(&Repetition { jobs: 1, ..repetition(4, 100) });
    assert_eq!(report, fly(&repetition(4, 100)));
    assert_eq!((&report.planner[..], &report.estimator[..]), (OWN, OWN));
    assert_eq!(Scenario::find("fleet-7").expect("it has a seed"), random_fleet(7));
    assert_ne!(random_fleet(7).world, random_fleet(8).world);
    assert!(Scenario::find("fleet-").is_err() && Scenario::find("fleet-+7").is_err());
}

/// The scenarios hold what they promise: all sizes, fences, zones, batteries and failures.
#[test]
fn everything_that_may_go_wrong_is_drawn() {
    let fleets: Vec<Scenario> = (0..300).map(random_fleet).collect();
    for size in 1..=8 {
        assert!(fleets.iter().any(|s| s.world.drones.len() == size), "{size} drones");
    }
    let drones = || fleets.iter().flat_map(|s| &s.world.drones);
    let share = |count: usize, of: usize| count * 100 / of;
    let failing = [
        drones().filter(|d| !d.stuck.is_empty()).count(),
        drones().filter(|d| !d.lost.is_empty()).count(),
        drones().filter(|d| !d.silent.is_empty()).count(),
        drones().filter(|d| d.late_s > 0.0).count(),
    ];
    for count in failing {
        assert!((5..20).contains(&share(count, drones().count())), "{failing:?}");
    }
    let some = [
        fleets.iter().filter(|s| !s.hunt.airspace.fence_m.is_empty()).count(),
        fleets.iter().filter(|s| !s.hunt.airspace.keep_out.is_empty()).count(),
        fleets.iter().filter(|s| s.hunt.endurance.is_some()).count(),
        fleets.iter().filter(|s| s.hunt.shared_turns).count(),
        fleets.iter().filter(|s| s.world.beacons.len() == 2).count(),
    ];
    assert!(some.iter().all(|count| (20..95).contains(&share(*count, 300))), "{some:?}");
    let seldom = [
        fleets.iter().filter(|s| s.hunt.void.is_some()).count(),
        fleets.iter().filter(|s| s.hunt.stop.least_gain_nats_per_s.is_some()).count(),
        fleets.iter().filter(|s| s.hunt.stop.settled_m.is_some()).count(),
        fleets.iter().filter(|s| appears_late(s)).count(),
    ];
    assert!(seldom.iter().all(|count| (5..40).contains(&share(*count, 300))), "{seldom:?}");
    // A file of such a scenario reads back as it was.
    let text = toml::to_string(&fleets[0]).expect("plain fields");
    assert_eq!(Scenario::parse(&text, "fleet").expect("in order").world, fleets[0].world);
}

fn appears_late(fleet: &Scenario) -> bool {
    let late: Vec<bool> =
        fleet.world.beacons.iter().map(|beacon| beacon.appears_after_s.is_some()).collect();
    let (last, others) = late.split_last().expect("there is a beacon");
    assert!(!others.contains(&true), "only the last beacon may be late");
    *last
}

/// Planners and shapes in 2000 fleets: the slow planner has a share of 1/250 in them, so that one
/// set of fleets in 3000 would be without it.
#[test]
fn every_planner_and_every_shape_is_drawn() {
    let planners: Vec<PlannerConfig> = (0..2000).map(|seed| random_fleet(seed).planner).collect();
    let count = |text: &str| {
        planners.iter().filter(|p| toml::to_string(p).expect("plain fields").contains(text)).count()
    };
    for kind in [
        "follow-estimate",
        "waypoints",
        "lawn-mower",
        "orbit",
        "arcs",
        "surge-cast",
        "information",
        "steepest-descent",
        "bayesian-optimisation",
        "hold",
        "emulated",
        "polygon",
        "line",
        "offsets",
        "scaled",
    ] {
        assert!(count(&format!("kind = \"{kind}\"")) > 0, "{kind}");
    }
    assert!(count("bayesian-optimisation") < 40);
    let built = planners.iter().find_map(|planner| planner.build().err());
    assert_eq!(built, None);
}

/// Ten thousand fleets.
#[test]
#[ignore = "campaign: ten thousand hunts, half an hour in release"]
fn ten_thousand_random_fleets_keep_what_they_must() {
    assert_safe(&fly(&repetition(10_000, 1)));
}
