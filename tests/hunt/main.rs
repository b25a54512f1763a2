//! What a hunt does when things go wrong, and that its log says it all.

mod fleets;
mod logs;
mod resumed;
#[path = "../support/mod.rs"]
mod support;

use std::{cell::Cell, fs, path::Path, rc::Rc};

use foxhunt::{
    config::{EstimatorConfig, ModelConfig, estimator_named, estimators},
    core::{BearingModes, Outcome},
    filters::{OutOfOrder, Ukf},
    formation::{FollowConfig, FollowEstimate, Hold, Phase},
    hunt::{Components, Event, Heard, HuntError, Track},
    log::{LOG_VERSION, Log, LogHeader, LogWriter, LoggedBeacon},
    prelude::*,
    replay::replay,
    sensors::{LogDistance, Pritzl2018, RssBearing},
};
use nalgebra::Vector2;
use support::{Cardioid, Health, LAW, Teleport};

/// Each within two standard deviations of the prior, which lies about where the drones are.
const TARGETS: [Vector2<f64>; 2] = [Vector2::new(12.0, -7.0), Vector2::new(5.0, 4.0)];

struct Outing {
    events: Vec<Event>,
    duration: f64,
}

/// Flies the toy world to its end.
fn fly(planner: impl FormationPlanner, healths: [Health; 3], stuck: bool) -> Outing {
    fly_as(TrackConfig::pritzl2018(), planner, healths, stuck)
}

/// The same, receptions being put to the filter as `track` has it.
fn fly_as(
    track: TrackConfig,
    planner: impl FormationPlanner,
    healths: [Health; 3],
    stuck: bool,
) -> Outing {
    fly_with(hunt_config(), track, planner, healths, stuck)
}

/// The same, with a hunt of another configuration.
fn fly_with(
    config: HuntConfig,
    track: TrackConfig,
    planner: impl FormationPlanner,
    healths: [Health; 3],
    stuck: bool,
) -> Outing {
    let model = RssBearing::new(LogDistance::new(LAW.0, LAW.1).expect("in range"));
    let time: support::Time = Rc::new(Cell::new(0.0));
    let mut vehicles = [(0.0, 0.0), (5.0, 0.0), (0.0, 5.0)].map(|(e, n)| Teleport::at(e, n));
    vehicles[0].stuck = stuck;
    let mut sources: Vec<Cardioid> = vehicles
        .iter()
        .zip(healths)
        .map(|(vehicle, health)| Cardioid::new(&time, vehicle, &TARGETS, health))
        .collect();
    let mut hunt = Hunt::new(
        Pritzl2018::default(),
        planner,
        |prior: &Estimate<2>| Ukf::pritzl2018(model, *prior),
        vec!["first".to_owned(), "second".to_owned()],
        config,
        track,
    )
    .expect("two beacons");
    let stations = vehicles.iter().map(|v| Station::holding(v.place.get())).collect();
    hunt.start(0.0, stations).expect("three drones");
    for (vehicle, health) in vehicles.iter_mut().zip(healths) {
        if health == Health::Astray {
            vehicle.stuck = true;
            vehicle.place.set(Pose::at(f64::NAN, 0.0, 4.0));
        }
    }
    let mut events = Vec::new();
    while !hunt.is_finished() {
        drive(&mut hunt, &mut sources, &mut vehicles[..], time.get()).expect("the hunt goes on");
        events.extend(std::iter::from_fn(|| hunt.poll_event()));
        time.set(time.get() + 0.25);
        assert!(time.get() < 100_000.0, "the hunt does not end");
    }
    Outing { events, duration: time.get() }
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
    assert!((delay - (timeout - 1.0)).abs() < 1.5, "each position took {delay} s longer");
    let missing = silent.events.iter().filter(|e| matches!(e, Event::Missing { drone: 1, .. }));
    assert_eq!(missing.count(), 2);
}

#[test]
fn a_broken_drone_is_told_of_once_in_each_phase() {
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
fn nothing_heard_gives_the_beacon_up_and_goes_on() {
    let outing = fly(triangle(), [Health::Silent; 3], false);
    assert_eq!(outcomes(&outing), [(Outcome::NothingHeard, 0, 0); 2]);
    let attempts = f64::from(HuntConfig::default().attempts);
    let least = 2.0 * attempts * HuntConfig::default().turn_timeout_s;
    assert!((outing.duration - least).abs() < 10.0, "it took {} s", outing.duration);
}

#[test]
fn a_stuck_drone_is_waited_for_so_long_and_then_used_where_it_is() {
    let outing = fly(triangle(), [Health::Good; 3], true);
    for (outcome, steps, positions) in outcomes(&outing) {
        assert_ne!(outcome, Outcome::NothingHeard);
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
    let told = outing.events.iter().filter(|event| match event {
        Event::DeviceFailed { drone: Some(1), reason, .. } => reason.contains("NaN"),
        _ => false,
    });
    assert!(told.count() > 0);
}

#[test]
fn a_hunt_begins_once() {
    let model = RssBearing::new(LogDistance::new(LAW.0, LAW.1).expect("in range"));
    let mut hunt = Hunt::<_, _, _, _, 2, 2>::new(
        Pritzl2018::default(),
        triangle(),
        |prior: &Estimate<2>| Ukf::pritzl2018(model, *prior),
        vec!["first".to_owned()],
        hunt_config(),
        TrackConfig::default(),
    )
    .expect("one beacon");
    hunt.start(0.0, vec![Station::holding(Pose::at(1.0, 2.0, 3.0))]).expect("one drone");
    let before = (hunt.stations().to_vec(), hunt.estimate(), hunt.phase());
    while hunt.poll_event().is_some() {}
    let error = hunt.start(1.0, vec![Station::default(); 2]).expect_err("it has begun");
    assert!(matches!(error, HuntError::Phase(_)), "{error}");
    assert_eq!((hunt.stations().to_vec(), hunt.estimate(), hunt.phase()), before);
    assert_eq!(hunt.poll_event(), None);
}

/// Pritzl 2018, §7.4.2, has the whole system on levels alone; what it discards are turns without
/// a bearing.
#[test]
fn levels_alone_go_with_the_rule_that_discards() {
    let model = RssBearing::new(LogDistance::new(LAW.0, LAW.1).expect("in range"));
    let prior = Estimate::isotropic(Vector2::new(1.0, 2.0), 8.0);
    let config = TrackConfig { components: Components::RssOnly, ..TrackConfig::pritzl2018() };
    let mut track = Track::new(Ukf::pritzl2018(model, prior).expect("a proper prior"), config);
    let turn = |bearing| Reception {
        beacon: BeaconId(0),
        time: 0.0,
        receiver: Pose::at(6.0, 0.0, 4.0),
        rss_dbm: -60.0,
        rss_sigma_db: 7.9,
        bearing,
        covariance: 0.0,
        modes: BearingModes::default(),
        receiver_sigma_m: None,
    };
    assert_eq!(track.hear(&turn(None), false), Ok(Heard::Discarded));
    assert_eq!(track.position(), prior);
    let told = |angle| {
        let mut track = track.clone();
        let bearing = Bearing { angle, sigma: 0.3, confidence: 1.0 };
        let heard = track.hear(&turn(Some(bearing)), false);
        assert!(matches!(heard, Ok(Heard::Corrected(Correction::Fused { .. }))), "{heard:?}");
        track.position()
    };
    assert_ne!(told(1.0), prior);
    assert_eq!(told(1.0), told(-2.0), "the bearing was used");
}
