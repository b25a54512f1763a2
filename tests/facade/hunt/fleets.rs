//! Drones that drop out and come back, rules that end a search, and the way home.

use approx::assert_abs_diff_eq;
use foxhunt::formation::{Duty, EnduranceConfig, StopRules};
use foxhunt::hunt::{Command, Fix};
use nalgebra::Vector3;

use super::*;

/// Interference of a test with its drones while the hunt is on.
type Meddle<'a> = dyn FnMut(f64, &mut [Toy]) + 'a;

/// Flies the toy world to its end; `meddle` is called before each look at the devices.
fn fly_while(
    config: HuntConfig,
    planner: impl FormationPlanner + 'static,
    meddle: &mut Meddle<'_>,
) -> (Vec<Event>, f64) {
    fly_with_another(config, planner, f64::INFINITY, meddle)
}

/// Flies it with a second beacon that appears at the given time, in seconds.
fn fly_with_another(
    config: HuntConfig,
    planner: impl FormationPlanner + 'static,
    appears: f64,
    meddle: &mut Meddle<'_>,
) -> (Vec<Event>, f64) {
    let time: Time = Rc::new(Cell::new(0.0));
    let mut drones = toys(&time);
    let track = TrackConfig::pritzl2018();
    let mut hunt = hunt_for(&["first"], config, track, planner).expect("a beacon");
    hunt.start(0.0, stations_of(&drones)).expect("three drones");
    let mut events = Vec::new();
    while !hunt.is_finished() {
        if time.get() > appears && hunt.beacon_count() == 1 {
            let beacon = hunt.add_beacon(time.get(), "second".to_owned());
            assert_eq!(beacon, Ok(BeaconId(1)));
        }
        meddle(time.get(), &mut drones);
        drive(&mut hunt, &mut drones, time.get()).expect("the hunt goes on");
        events.extend(std::iter::from_fn(|| hunt.poll_event()));
        time.set(time.get() + 0.25);
        assert!(time.get() < 100_000.0, "the hunt does not end");
    }
    assert!(hunt.add_beacon(time.get(), "third".to_owned()).is_err(), "it is over");
    (events, time.get())
}

fn duties(events: &[Event], of: usize) -> Vec<Duty> {
    let duty = |event: &Event| match event {
        Event::DutyChanged { drone, duty, .. } if *drone == of => Some(*duty),
        _ => None,
    };
    events.iter().filter_map(duty).collect()
}

fn fixes(events: &[Event]) -> Vec<&Fix> {
    let fixes = events.iter().filter_map(|event| match event {
        Event::BeaconFinished { fix, .. } => Some(fix),
        _ => None,
    });
    fixes.collect()
}

/// The fix of a hunt for one beacon.
fn fix(events: &[Event]) -> &Fix {
    let all = fixes(events);
    assert_eq!(all.len(), 1);
    all[0]
}

fn goals(events: &[Event]) -> Vec<&Vec<Vector3<f64>>> {
    let goals = events.iter().filter_map(|event| match event {
        Event::GoalsSet { goals, .. } => Some(goals),
        _ => None,
    });
    goals.collect()
}

#[test]
fn a_drone_that_falls_silent_is_left_out_and_taken_in_again() {
    let (events, duration) = fly_while(hunt_config(), Hold::new(8), &mut |time, drones| {
        // Silent for the first four positions: two of 90 s, and two without waiting for it.
        let silent = time < 182.5;
        drones[1].source.health = if silent { Health::Silent } else { Health::Good };
    });
    assert_eq!(duties(&events, 1), [Duty::Silent, Duty::Formation]);
    assert!(duration < 2.0 * 90.0 + 6.0 * 3.0, "nobody waits for it: {duration} s");
    let received = events.iter().filter(|e| matches!(e, Event::Received { drone: 1, .. })).count();
    assert!((4..8).contains(&received), "{received}");
    assert_eq!(fix(&events).formation_positions, 8);
}

#[test]
fn the_formation_closes_up_around_one_that_does_not_move() {
    let (events, _) = fly_while(hunt_config(), triangle(), &mut |time, drones| {
        drones[2].vehicle.stuck = time > 2.0;
    });
    assert_eq!(duties(&events, 2)[0], Duty::Still);
    assert_eq!(fix(&events).outcome, Outcome::Converged);
    // Two drones are opposite each other, 6 m from the centre, and not on top of the third.
    let last = goals(&events).last().copied().expect("there were goals").clone();
    assert_abs_diff_eq!((last[0] - last[1]).xy().norm(), 12.0, epsilon = 1.0);
    let near = |a: usize, b: usize| (last[a] - last[b]).xy().norm();
    assert!(near(0, 2) > 2.0 && near(1, 2) > 2.0, "{last:?}");
    // It listens where it is.
    let received = events.iter().filter(|e| matches!(e, Event::Received { drone: 2, .. })).count();
    assert_eq!(received, usize::try_from(fix(&events).formation_positions).expect("few"));
}

#[test]
fn one_that_is_not_located_is_lost_and_found() {
    let place = Cell::new(Pose::default());
    let (events, _) = fly_while(hunt_config(), triangle(), &mut |time, drones| {
        let gone = (2.0..20.0).contains(&time);
        if gone && drones[0].vehicle.place.get().is_finite() {
            place.set(drones[0].vehicle.place.get());
            drones[0].vehicle.stuck = true;
            drones[0].vehicle.place.set(Pose::at(f64::NAN, 0.0, 4.0));
        } else if !gone && !drones[0].vehicle.place.get().is_finite() {
            drones[0].vehicle.stuck = false;
            drones[0].vehicle.place.set(place.get());
        }
    });
    assert_eq!(duties(&events, 0)[..1], [Duty::Lost]);
    assert_eq!(fix(&events).outcome, Outcome::Converged);
}

#[test]
fn rules_end_a_search_and_the_log_has_the_reason() {
    let rules = |stop| HuntConfig { stop, ..hunt_config() };
    let none = StopRules::default();
    let cases = [
        (StopRules { ellipse_95_m: Some(8.0), ..none }, Outcome::EllipseReached),
        (StopRules { positions: Some(2), ..none }, Outcome::MoveLimit),
        (StopRules { time_s: Some(2.0), ..none }, Outcome::BudgetSpent),
        (StopRules { path_m: Some(1.0), ..none }, Outcome::BudgetSpent),
        (StopRules { settled_m: Some(5.0), ..none }, Outcome::Converged),
        (StopRules { least_gain_nats_per_s: Some(10.0), ..none }, Outcome::LittleToLearn),
    ];
    for (stop, outcome) in cases {
        let (events, _) = fly_while(rules(stop), triangle(), &mut |_, _| {});
        assert_eq!(fix(&events).outcome, outcome, "{stop:?}");
        let stopped = events.iter().filter(|event| match event {
            Event::Stopped { outcome: logged, reason, .. } => {
                *logged == outcome && !reason.is_empty()
            }
            _ => false,
        });
        assert_eq!(stopped.count(), 1, "{stop:?}");
    }
    let stop = StopRules { time_s: Some(-1.0), ..none };
    let error = hunt_for(&["first"], rules(stop), TrackConfig::default(), triangle());
    let error = error.expect_err("a time before the beginning").to_string();
    assert!(error.contains("stop.time_s") && error.contains("-1"), "{error}");
}

#[test]
fn everyone_is_home_before_the_batteries_are_empty() {
    let endurance = EnduranceConfig { endurance_s: 60.0, reserve_s: 10.0, ..Default::default() };
    let config = HuntConfig { endurance: Some(endurance), ..hunt_config() };
    let places = Rc::new(Cell::new([Vector3::zeros(); 3]));
    let (events, duration) = fly_while(config, Hold::new(1000), &mut |_, drones| {
        places.set([0, 1, 2].map(|drone| drones[drone].vehicle.place.get().position));
    });
    assert_eq!(fix(&events).outcome, Outcome::BudgetSpent);
    assert!(duration < 60.0, "{duration} s");
    let homes = [(0.0, 0.0), (5.0, 0.0), (0.0, 5.0)];
    for (place, (east, north)) in places.get().iter().zip(homes) {
        assert!((place.xy() - Vector2::new(east, north)).norm() < 0.31, "{place}");
    }
    let landed = events.iter().filter(|e| matches!(e, Event::Landed { .. })).count();
    assert_eq!(landed, 3);
    assert_eq!(events.iter().filter(|e| matches!(e, Event::Recalled { .. })).count(), 1);
}

#[test]
fn a_planner_that_gives_up_ends_its_search_and_not_the_hunt() {
    let mut turns = 0;
    let planner = foxhunt::core::planner_fn(move |_: &dyn Belief, _: &mut [Station]| {
        turns += 1;
        if turns > 3 {
            return Err(PlanError::TooFew { needed: 4, have: 3 });
        }
        Ok(Decision::Listen(Stage::Searching))
    });
    let (events, _) = fly_while(hunt_config(), planner, &mut |_, _| {});
    let fix = fix(&events);
    assert_eq!((fix.outcome, fix.formation_positions), (Outcome::NoPlan, 4));
    assert!(events.iter().any(|event| match event {
        Event::Stopped { reason, .. } => reason.contains("needs 4 drones and has 3"),
        _ => false,
    }));
}

#[test]
fn a_start_that_breaks_the_rules_is_refused_and_changes_nothing() {
    let mut hunt = hunt_for(&["first"], hunt_config(), TrackConfig::default(), triangle())
        .expect("one beacon");
    let at = |east| Station::holding(Pose::at(east, 0.0, 4.0));
    let error = hunt.start(0.0, vec![at(0.0), at(1.0)]).expect_err("1 m is too near");
    assert!(error.to_string().contains('1'), "{error}");
    assert!(hunt.poll_event().is_none() && hunt.stations().is_empty());
    hunt.start(0.0, vec![at(0.0), at(10.0)]).expect("10 m is not");
    hunt.advance(0.0).expect("it goes on");
    assert!(matches!(hunt.poll_command(), Some(Command::GoTo { .. })));
}

#[test]
fn beacons_that_appear_later_are_added() {
    for shared_turns in [false, true] {
        let config = HuntConfig { shared_turns, ..hunt_config() };
        let (events, _) = fly_with_another(config, triangle(), 3.0, &mut |_, _| {});
        let fixes = fixes(&events);
        assert_eq!(fixes.len(), 2, "shared turns: {shared_turns}");
        for (fix, truth) in fixes.into_iter().zip(TARGETS) {
            let miss = (fix.estimate.mean - truth).norm();
            assert!(miss < 1.5, "{} is {miss} m off", fix.name);
        }
    }
}

#[test]
fn budgets_end_a_search_wherever_the_drones_are() {
    // Every turn times out, so that no formation position is ever done before the budget is.
    let stop = StopRules { time_s: Some(30.0), ..StopRules::default() };
    let (events, duration) =
        fly_while(HuntConfig { stop, ..hunt_config() }, triangle(), &mut |_, drones| {
            drones.iter_mut().for_each(|drone| drone.source.health = Health::Silent);
        });
    assert_eq!(fix(&events).outcome, Outcome::BudgetSpent);
    assert!((30.0..31.0).contains(&duration), "{duration} s");
}

#[test]
fn drones_that_are_not_located_any_more_end_the_hunt() {
    let config = HuntConfig { return_home: true, ..hunt_config() };
    let (events, duration) = fly_while(config, triangle(), &mut |time, drones| {
        if time > 2.0 {
            for drone in drones {
                drone.vehicle.stuck = true;
                drone.vehicle.place.set(Pose::at(f64::NAN, 0.0, 4.0));
                drone.source.health = Health::Silent;
            }
        }
    });
    assert_eq!(fix(&events).outcome, Outcome::NoDrones);
    let timeout = HuntConfig::default().move_timeout_s;
    assert!(duration < 3.0 * timeout + 30.0, "{duration} s");
}

#[test]
fn a_beacon_that_falls_silent_is_put_off_and_then_given_up() {
    // The first is received at the start alone; a rule ends the second while the first is sought.
    for ellipse_95_m in [None, Some(6.0)] {
        let stop = StopRules { ellipse_95_m, ..StopRules::default() };
        let config = HuntConfig { shared_turns: true, stop, ..hunt_config() };
        let (events, _) = fly_with_another(config, Hold::new(9), 0.1, &mut |time, drones| {
            for drone in drones {
                drone.source.deaf_to = (time > 2.5).then_some(BeaconId(0));
            }
        });
        let fixes = fixes(&events);
        let outcomes: Vec<Outcome> = fixes.iter().map(|fix| fix.outcome).collect();
        assert!(outcomes.contains(&Outcome::SignalLost), "{outcomes:?}");
        assert!(!outcomes.contains(&Outcome::NoPlan), "{outcomes:?}");
        assert_eq!(fixes.len(), 2);
    }
}
