//! Hunts in which things go wrong, and logs that hold all of it.

mod fleets;
mod logs;
mod resumed;

use approx::assert_abs_diff_eq;
use std::{cell::Cell, fs, path::Path, rc::Rc};

use foxhunt::{
    config::{EstimatorConfig, ModelConfig},
    core::Outcome,
    filters::{OutOfOrder, Ukf},
    formation::{FollowConfig, FollowEstimate, Hold, Phase, Polygon, Waypoints},
    hunt::{Components, HuntError, TrackStep},
    log::{LOG_VERSION, Log, LogHeader, LogWriter, LoggedBeacon},
    prelude::*,
    replay::replay,
    sensors::{LogDistance, Pritzl2018, RssBearing},
};
use nalgebra::{Vector2, Vector3};

use crate::support::{Cardioid, Health, LAW, Teleport, Time, Toy, entry};

/// Each within two standard deviations of the prior, which lies about where the drones are.
const TARGETS: [Vector2<f64>; 2] = [Vector2::new(12.0, -7.0), Vector2::new(5.0, 4.0)];

struct Outing {
    events: Vec<Event>,
    duration: f64,
}

/// Flies the toy world to its end.
fn fly(planner: impl FormationPlanner + 'static, healths: [Health; 3], stuck: bool) -> Outing {
    fly_as(TrackConfig::pritzl2018(), planner, healths, stuck)
}

/// Flies it with the settings of a track.
fn fly_as(
    track: TrackConfig,
    planner: impl FormationPlanner + 'static,
    healths: [Health; 3],
    stuck: bool,
) -> Outing {
    fly_with(hunt_config(), track, planner, healths, stuck)
}

/// Flies it with the settings of a hunt and of a track.
fn fly_with(
    config: HuntConfig,
    track: TrackConfig,
    planner: impl FormationPlanner + 'static,
    healths: [Health; 3],
    stuck: bool,
) -> Outing {
    let time: Time = Rc::new(Cell::new(0.0));
    let mut drones = toys(&time);
    drones[0].vehicle.stuck = stuck;
    for (drone, health) in drones.iter_mut().zip(healths) {
        drone.source.health = health;
    }
    let mut hunt = hunt_for(&["first", "second"], config, track, planner).expect("two beacons");
    hunt.start(0.0, stations_of(&drones)).expect("three drones");
    for (drone, health) in drones.iter_mut().zip(healths) {
        if health == Health::Astray {
            drone.vehicle.stuck = true;
            drone.vehicle.place.set(Pose::at(f64::NAN, 0.0, 4.0));
        }
    }
    let mut events = Vec::new();
    while !hunt.is_finished() {
        drive(&mut hunt, &mut drones, time.get()).expect("the hunt goes on");
        events.extend(std::iter::from_fn(|| hunt.poll_event()));
        time.set(time.get() + 0.25);
        assert!(time.get() < 100_000.0, "the hunt does not end");
    }
    Outing { events, duration: time.get() }
}

/// Three drones that work, in a right angle.
fn toys(time: &Time) -> [Toy; 3] {
    [(0.0, 0.0), (5.0, 0.0), (0.0, 5.0)].map(|(east, north)| {
        let vehicle = Teleport::at(east, north);
        Drone { source: Cardioid::new(time, &vehicle, &TARGETS, Health::Good), vehicle }
    })
}

fn stations_of(drones: &[Toy]) -> Vec<Station> {
    drones.iter().map(|drone| Station::holding(drone.vehicle.place.get())).collect()
}

/// A hunt with the reference's filter, that has not begun.
fn hunt_for(
    beacons: &[&str],
    config: HuntConfig,
    track: TrackConfig,
    planner: impl FormationPlanner + 'static,
) -> Result<Hunt, HuntError> {
    let parts = Parts::new(Pritzl2018::default(), planner, move |search: &Search<'_>| {
        Ok(Track::new(Ukf::pritzl2018(model(), search.prior)?, track))
    });
    Hunt::new(parts, beacons.iter().map(|&name| name.to_owned()).collect(), config)
}

fn model() -> RssBearing<LogDistance> {
    RssBearing::new(LogDistance::new(LAW.0, LAW.1).expect("in range"))
}

/// The reference's prior, for the reference's filter.
fn hunt_config() -> HuntConfig {
    HuntConfig { prior_sigma_m: 70.0_f64.sqrt(), ..HuntConfig::default() }
}

fn triangle() -> FollowEstimate {
    FollowEstimate::new(FollowConfig::pritzl2018()).expect("the preset is in range")
}

fn outcomes(outing: &Outing) -> Vec<(Outcome, u32, u32)> {
    let fix = |event: &Event| match event {
        Event::BeaconFinished { fix, .. } => {
            Some((fix.outcome, fix.steps, fix.formation_positions))
        }
        _ => None,
    };
    outing.events.iter().filter_map(fix).collect()
}

#[test]
fn all_goes_well() {
    let outing = fly(triangle(), [Health::Good; 3], false);
    for (outcome, steps, positions) in outcomes(&outing) {
        assert_eq!(outcome, Outcome::Converged);
        assert_eq!(steps, 3 * positions);
        // Three positions at least, and four more for finishing.
        assert!(positions >= 7);
    }
    let fixes = outing.events.iter().filter_map(|event| match event {
        Event::BeaconFinished { fix, .. } => Some(fix.estimate.mean),
        _ => None,
    });
    for (found, truth) in fixes.zip(TARGETS) {
        assert!((found - truth).norm() < 1.5, "found at {found}, it is at {truth}");
    }
    let forming_up = outing
        .events
        .iter()
        .filter(|e| matches!(e, Event::PhaseChanged { phase, .. } if *phase == Phase::Start));
    assert_eq!(forming_up.count(), 2);
}

#[test]
fn a_silent_drone_costs_its_time_out_twice_and_no_more() {
    let good = fly(Hold::new(4), [Health::Good; 3], false);
    let silent = fly(Hold::new(4), [Health::Good, Health::Silent, Health::Good], false);
    assert_eq!(outcomes(&silent), [(Outcome::MoveLimit, 8, 4); 2]);
    // Two formation positions, each longer by the time-out less the second that a turn takes.
    let delay = (silent.duration - good.duration) / 2.0;
    let timeout = HuntConfig::default().turn_timeout_s;
    assert_abs_diff_eq!(delay, timeout - 1.0, epsilon = 1.5);
    let missing = silent.events.iter().filter(|e| matches!(e, Event::Missing { drone: 1, .. }));
    assert_eq!(missing.count(), 2);
}

#[test]
fn a_broken_drone_is_noted_once_in_each_phase() {
    let outing = fly(Hold::new(2), [Health::Broken, Health::Good, Health::Good], false);
    assert_eq!(outcomes(&outing), [(Outcome::MoveLimit, 4, 2); 2]);
    let failures: Vec<&Event> =
        outing.events.iter().filter(|e| matches!(e, Event::DeviceFailed { .. })).collect();
    // It owes its sweeps, late ones being welcome, until the next turn: four positions and the
    // moves after them.
    assert_eq!(failures.len(), 8);
    for event in failures {
        let Event::DeviceFailed { drone, reason, .. } = event else { unreachable!("filtered") };
        assert_eq!((*drone, reason.as_str()), (Some(0), "the cable is unplugged"));
    }
}

#[test]
fn no_signal_gives_the_beacon_up_and_goes_on() {
    let outing = fly(triangle(), [Health::Silent; 3], false);
    assert_eq!(outcomes(&outing), [(Outcome::NoSignal, 0, 0); 2]);
    let attempts = f64::from(HuntConfig::default().attempts);
    let least = 2.0 * attempts * HuntConfig::default().turn_timeout_s;
    assert_abs_diff_eq!(outing.duration, least, epsilon = 10.0);
}

#[test]
fn a_path_is_flown_to_its_end_where_nothing_is_received() {
    let places = [[0.0, 0.0, 4.0], [9.0, 0.0, 4.0]].map(Vector3::from);
    let path = Waypoints::new(places, Polygon { circumradius: 6.0 }, 0.0).expect("a path");
    let outing = fly(path, [Health::Silent; 3], false);
    assert_eq!(outcomes(&outing), [(Outcome::NoSignal, 0, 0); 2]);
    let goals = outing.events.iter().filter(|event| matches!(event, Event::GoalsSet { .. }));
    assert!(goals.count() >= 4, "both places, for each of two beacons");
    let attempts = f64::from(HuntConfig::default().attempts);
    let least = 4.0 * attempts * HuntConfig::default().turn_timeout_s;
    assert_abs_diff_eq!(outing.duration, least, epsilon = 60.0);
}

#[test]
fn a_stuck_drone_is_waited_for_so_long_and_then_used_where_it_is() {
    let outing = fly(triangle(), [Health::Good; 3], true);
    for (outcome, steps, positions) in outcomes(&outing) {
        assert_ne!(outcome, Outcome::NoSignal);
        assert_eq!(steps, 3 * positions);
    }
    for event in &outing.events {
        if let Event::Received { drone: 0, reception, .. } = event {
            assert!(reception.receiver.position.xy().norm() < 1e-12);
        }
    }
}

#[test]
fn a_drone_that_is_nowhere_does_not_stop_the_others() {
    let outing = fly(triangle(), [Health::Good, Health::Astray, Health::Good], false);
    for (outcome, steps, positions) in outcomes(&outing) {
        assert_eq!((outcome, steps), (Outcome::Converged, 2 * positions));
    }
    let noted = outing.events.iter().filter(|event| match event {
        Event::DeviceFailed { drone: Some(1), reason, .. } => reason.contains("NaN"),
        _ => false,
    });
    assert!(noted.count() > 0);
}

#[test]
fn a_hunt_begins_once() {
    let mut hunt = hunt_for(&["first"], hunt_config(), TrackConfig::default(), triangle())
        .expect("one beacon");
    hunt.start(0.0, vec![Station::holding(Pose::at(1.0, 2.0, 3.0))]).expect("one drone");
    let before = (hunt.stations(), hunt.estimate(), hunt.phase());
    while hunt.poll_event().is_some() {}
    let error = hunt.start(1.0, vec![Station::default(); 2]).expect_err("it has begun");
    assert!(matches!(error, HuntError::Phase(_)), "{error}");
    assert_eq!((hunt.stations(), hunt.estimate(), hunt.phase()), before);
    assert_eq!(hunt.poll_event(), None);
}

/// Pritzl 2018, §7.4.2, has the whole system on levels alone; what it discards are turns without
/// a bearing.
#[test]
fn levels_alone_go_with_the_rule_that_discards() {
    let prior = Estimate::isotropic(Vector2::new(1.0, 2.0), 8.0);
    let config = TrackConfig { components: Components::RssOnly, ..TrackConfig::pritzl2018() };
    let fresh = || Track::new(Ukf::pritzl2018(model(), prior).expect("a proper prior"), config);
    let turn = |bearing| Reception {
        receiver: Pose::at(6.0, 0.0, 4.0),
        level: Some(Level { rss_dbm: -60.0, sigma_db: 7.9 }),
        bearing,
        ..Reception::default()
    };
    let mut track = fresh();
    assert_eq!(track.update(&turn(None), false), Ok(TrackStep::Skipped));
    assert_eq!(track.position(), prior);
    let after = |angle| {
        let mut track = fresh();
        let bearing = Bearing { angle, sigma: 0.3, confidence: 1.0 };
        let step = track.update(&turn(Some(bearing)), false);
        let fused = |step| {
            matches!(step, Ok(TrackStep::Updated { correction: Correction::Fused { .. }, .. }))
        };
        assert!(fused(step), "{step:?}");
        track.position()
    };
    assert_ne!(after(1.0), prior);
    assert_eq!(after(1.0), after(-2.0), "the bearing was used");
}
