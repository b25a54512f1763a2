//! Hunts with what a scenario's drones listen with.

use approx::assert_abs_diff_eq;
use std::convert::Infallible;

use foxhunt::{
    config::SourceConfig,
    log::{Log, LogWriter},
    prelude::*,
    replay::replay,
    scenario::ScenarioError,
    sensors::{BodyConfig, OmnidirectionalConfig},
    simulation::Simulated,
};
use nalgebra::Vector2;

use crate::support::entry;

/// Flies a scenario with its own estimator, seed 1.
fn fly(scenario: &Scenario) -> (Simulated, Vec<Event>) {
    let registry = Registry::builtin();
    let estimator = registry.estimator(&scenario.estimator).expect("it has a name");
    let setup = Setup { scenario, estimator, registry: &registry };
    let mut events = Vec::new();
    let flown = setup.simulate(1, |event| {
        events.push(event.clone());
        Ok::<_, Infallible>(())
    });
    (flown.expect("the hunt goes on"), events)
}

fn receptions(events: &[Event]) -> impl Iterator<Item = (usize, &Reception)> {
    events.iter().filter_map(|event| match event {
        Event::Received { drone, reception, .. } => Some((*drone, reception)),
        _ => None,
    })
}

/// The events through a log, which has to replay to the bit.
fn replayed(scenario: &Scenario, events: &[Event]) -> Log {
    let registry = Registry::builtin();
    let estimator = registry.estimator(&scenario.estimator).expect("it has a name");
    let header = Setup { scenario, estimator, registry: &registry }.log_header(1);
    let mut text = Vec::new();
    let mut writer = LogWriter::new(&mut text, &header).expect("memory");
    for event in events {
        writer.event(event).expect("memory takes everything");
    }
    let text = String::from_utf8(text).expect("JSON is UTF-8");
    let log = Log::parse(&text, "flown.jsonl".as_ref()).expect("its own output");
    assert_eq!(log.events, events);
    let replay = replay(&log, &registry, None).expect("its own configuration");
    assert!(replay.compared > 0);
    assert_eq!(replay.different, 0);
    log
}

#[test]
fn the_rooms_of_isaacs_are_flown_from_samples_up() {
    for (name, most, turns) in
        [("isaacs-static", 1.0, 48), ("isaacs-line", 2.5, 32), ("isaacs-circle", 3.0, 48)]
    {
        let scenario = Scenario::find(name).expect("built in");
        let (flown, events) = fly(&scenario);
        let found = &flown.found[0];
        assert_eq!(found.fix.steps, turns);
        assert!(found.error_m() < most, "{name}: {} m off", found.error_m());
        let clouds = events.iter().filter_map(|event| match event {
            Event::Cloud { places, .. } => Some(places),
            _ => None,
        });
        let cloud = clouds.collect::<Vec<_>>();
        assert_eq!((cloud.len(), cloud[0].len()), (1, 300));
        let mean = cloud[0].iter().sum::<Vector2<f64>>() / 300.0;
        assert!((mean - found.fix.estimate.mean).norm() < 0.2, "the cloud is the belief");
        if name == "isaacs-line" {
            let covariance = found.fix.estimate.covariance;
            assert!(covariance[(1, 1)] > 2.0 * covariance[(0, 0)], "the depth: {covariance}");
        }
        // The body turns all the time, and the turns are where the drone hovers or still drifts.
        let mut headings: Vec<f64> = receptions(&events).map(|(_, r)| r.receiver.heading).collect();
        headings.sort_by(f64::total_cmp);
        assert!(headings[headings.len() - 1] - headings[0] > 3.0, "{name}: it turns");
        replayed(&scenario, &events);
    }
}

#[test]
fn an_error_is_against_where_the_beacon_was_then() {
    let scenario = Scenario::find("isaacs-circle").expect("built in");
    let (flown, events) = fly(&scenario);
    let last = receptions(&events).map(|(_, reception)| reception.time).fold(0.0, f64::max);
    let angle = std::f64::consts::TAU * last / 400.0;
    let there = Vector2::new(angle.cos(), angle.sin()) * 1.5;
    assert!((flown.found[0].truth - there).norm() < 1e-9);
    let log = replayed(&scenario, &events);
    let known = log.header.beacons[0].place_at(last).expect("the header knows");
    assert!((known - there).norm() < 1e-9);
    let fix = &replay(&log, &Registry::builtin(), None).expect("its own").fixes[0];
    assert_abs_diff_eq!(fix.time, last, epsilon = 1e-12);
}

/// The pulses of a turn are receptions of their own, along boresights all round.
#[test]
fn pulses_are_flown_one_by_one() {
    let mut scenario = Scenario::find("vhf-tag").expect("built in");
    "pulses".clone_into(&mut scenario.estimator);
    scenario.hunt.stop.time_s = Some(40.0);
    let (_, events) = fly(&scenario);
    let boresights: Vec<f64> = receptions(&events)
        .filter_map(|(_, reception)| Some(reception.measured.get(Quantity::BORESIGHT)?.value))
        .collect();
    assert_eq!(boresights.len(), receptions(&events).count());
    assert!(boresights.len() >= 48 && boresights.iter().any(|angle| angle.abs() > 3.0));
    replayed(&scenario, &events);
    // Without a direction there is nothing to take one by one.
    scenario.source = SourceConfig::Omnidirectional(OmnidirectionalConfig::default());
    let registry = Registry::builtin();
    let estimator = registry.estimator("pulses").expect("it has a name");
    let refused = Setup { scenario: &scenario, estimator, registry: &registry }
        .simulate(1, |_| Ok::<_, Infallible>(()));
    let error = refused.expect_err("no boresights").to_string();
    assert!(error.contains("boresight_rad"), "{error}");
}

#[test]
fn one_of_three_drones_turns_its_body() {
    let scenario = Scenario::find("pritzl-7.5").expect("built in");
    let (flown, events) = fly(&scenario);
    assert!(flown.found[0].error_m() < 8.0, "{} m off", flown.found[0].error_m());
    for drone in 0..3 {
        let own: Vec<_> = receptions(&events).filter(|(who, _)| *who == drone).collect();
        assert!(own.len() >= 7 && own.iter().any(|(_, reception)| reception.bearing.is_some()));
        let turned = own.iter().any(|(_, r)| r.receiver.heading.abs() > 1e-6);
        assert_eq!(turned, drone == 2, "drone {drone}");
    }
}

/// One drone at 15 places, two of them in dead zones: it flies on after a place without a signal.
#[test]
fn one_drone_has_the_places_of_three() {
    let scenario = Scenario::find("pritzl-7.2-flown").expect("built in");
    let (flown, events) = fly(&scenario);
    assert_eq!(flown.found[0].fix.outcome, Outcome::PathDone);
    assert_eq!(flown.found[0].fix.steps, 13);
    let places: Vec<_> = receptions(&events).map(|(_, r)| r.receiver.position).collect();
    let silent = [[-10.0, -7.0], [-10.0, 1.9]].map(Vector2::from);
    assert!(silent.iter().all(|dead| places.iter().all(|p| (p.xy() - dead).norm() > 4.0)));
}

/// The path loss of three heights, of a known beacon: 34 levels.
#[test]
fn a_path_has_heights_of_its_own() {
    let (flown, events) = fly(&Scenario::find("pritzl-7.1").expect("built in"));
    assert_eq!(flown.found[0].fix.steps, 34);
    let at = |up_m: f64| {
        receptions(&events).filter(|(_, r)| (r.receiver.position.z - up_m).abs() < 0.3).count()
    };
    assert_eq!([at(5.0), at(2.5), at(7.5)], [18, 8, 8]);
}

#[test]
fn without_a_direction_there_are_levels_alone() {
    let mut scenario = Scenario::find("pritzl-7.4").expect("built in");
    scenario.estimator = "grid".to_owned();
    scenario.source = SourceConfig::Omnidirectional(OmnidirectionalConfig {
        questions: 50,
        ..OmnidirectionalConfig::default()
    });
    let (flown, events) = fly(&scenario);
    assert_eq!(flown.found[0].fix.steps, 48);
    assert!(receptions(&events).all(|(_, reception)| reception.bearing.is_none()));
    assert!(flown.found[0].error_m() < 8.0, "{} m off", flown.found[0].error_m());
}

#[test]
fn simulated_beacons_share_turns_of_either_kind() {
    for source in [SourceConfig::default(), SourceConfig::RotatingBody(BodyConfig::isaacs2014())] {
        let mut scenario = Scenario::find("pritzl-6.1").expect("built in");
        scenario.estimator = "ekf-iterated".to_owned();
        scenario.source = source;
        let (apart, _) = fly(&scenario);
        scenario.hunt.shared_turns = true;
        let (shared, events) = fly(&scenario);
        for found in &shared.found {
            assert!(found.error_m() < 5.0, "{} m off", found.error_m());
        }
        let steps = |flown: &Simulated| flown.found.iter().map(|f| f.fix.steps).collect::<Vec<_>>();
        assert!(steps(&shared)[1] > steps(&apart)[1] + 10, "the second is received all the time");
        replayed(&scenario, &events);
    }
}

#[test]
fn there_is_a_source_for_every_drone_or_for_all() {
    let text = include_str!("../../hunt/scenarios/pritzl-7.5.toml");
    let one_less = text.replacen("[[sources]]\nkind = \"stepper\"\n", "", 1);
    let error = Scenario::parse(&one_less, "mine.toml").expect_err("two for three");
    assert!(matches!(error, ScenarioError::Sources { sources: 2, drones: 3, .. }), "{error}");
    let misspelt = text.replace("rotating-body", "rotating-boddy");
    assert!(Scenario::parse(&misspelt, "mine.toml").is_err());
    let still = text.replace("rate_rad_s = 0.4908738521234052", "rate_rad_s = 0.0");
    let scenario = Scenario::parse(&still, "mine.toml").expect("the field is a number");
    let setup =
        Setup { scenario: &scenario, estimator: &entry("ekf"), registry: &Registry::builtin() };
    let error =
        setup.simulate(1, |_| Ok::<_, Infallible>(())).expect_err("a body that turns at no rate");
    assert!(error.to_string().contains("rate_rad_s is 0"), "{error}");
}
