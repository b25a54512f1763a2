//! Scripted flights.

use approx::assert_abs_diff_eq;
use foxhunt_formation::{
    Airspace, AirspaceConfig, KeepOut, OrderReason, Traffic, TrafficConfig, TrafficError, Travel,
    Void,
};
use nalgebra::Vector3;

use crate::{
    airspace::corner,
    flown::{Flown, at, formation},
};

#[test]
fn a_way_leads_around_a_corner() {
    let mut flown = Flown::new(&corner(), &[at(5.0, 18.0)]);
    flown.traffic.go(0, &at(18.0, 5.0)).expect("there is one");
    flown.step(&[]);
    assert_eq!(flown.traffic.status(0), Travel::UnderWay);
    let length: f64 =
        flown.traffic.reserved(0).windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
    // Around (10, 10) by half a metre: two tangents and a bit of an arc.
    let shortest = 2.0 * (5.0_f64 * 5.0 + 8.0 * 8.0).sqrt() + 0.3;
    assert!(length < shortest + 0.2 && length > shortest - 0.6, "{length}, {shortest}");
    flown.settle();
    assert!((flown.places[0] - at(18.0, 5.0)).norm() < 0.5);
    assert_eq!(flown.reasons(0)[0], OrderReason::Around);
    assert_eq!(flown.reasons(0)[1], OrderReason::Corner);
}

#[test]
fn crossing_ways_are_flown_in_turn() {
    let mut flown = Flown::new(&AirspaceConfig::default(), &[at(0.0, 0.0), at(20.0, 0.0)]);
    flown.traffic.go(0, &at(20.0, 20.0)).expect("there are two");
    flown.traffic.go(1, &at(0.0, 20.0)).expect("there are two");
    flown.step(&[]);
    assert_eq!(flown.traffic.status(0), Travel::UnderWay);
    assert_eq!(flown.traffic.status(1), Travel::Waiting);
    // The first gets stuck in the middle, and is silent.
    for _ in 0..140 {
        flown.step(&[]);
    }
    for _ in 0..2000 {
        flown.step(&[0]);
    }
    assert_eq!(flown.traffic.status(1), Travel::Waiting);
    flown.settle();
    assert!((flown.places[1] - at(0.0, 20.0)).norm() < 0.5);
    assert!(flown.least >= 2.0, "{}", flown.least);
}

#[test]
fn one_that_waits_sets_off_as_soon_as_the_line_is_released() {
    // The first flies 100 s; after 13 m, which take 6.5 s, it is 3 m past the second's line.
    let mut flown = Flown::new(&AirspaceConfig::default(), &[at(0.0, 0.0), at(10.0, -10.0)]);
    flown.traffic.go(0, &at(200.0, 0.0)).expect("there are two");
    flown.traffic.go(1, &at(10.0, 10.0)).expect("there are two");
    while flown.traffic.status(1) != Travel::UnderWay {
        flown.step(&[]);
        assert!(flown.seconds < 7.2, "it waits at {} s", flown.seconds);
    }
    assert!(flown.seconds > 6.4, "it sets off at {} s", flown.seconds);
    assert_eq!(flown.reasons(1), [OrderReason::Straight]);
}

#[test]
fn nothing_happens_before_one_arrives_or_has_released_enough() {
    let east = |speed: f64| Vector3::new(speed, 0.0, 0.0);
    let places = [at(0.0, 0.0), at(10.0, -10.0)];
    let mut flown = Flown::new(&AirspaceConfig::default(), &places);
    let resting = places.map(|place| (place, east(0.0)));
    assert_eq!(flown.traffic.undisturbed_s(&resting), Some(f64::INFINITY));
    assert_eq!(flown.traffic.undisturbed_s(&resting[..1]), None);
    flown.traffic.go(0, &at(200.0, 0.0)).expect("there are two");
    assert_eq!(flown.traffic.undisturbed_s(&resting), None, "it is sent off at once");
    let _ = flown.traffic.step();
    for (drone, place) in places.iter().enumerate() {
        flown.traffic.locate(drone, place);
    }
    let _ = flown.traffic.step();
    let flies = |velocity| [(places[0], velocity), (places[1], east(0.0))];
    let tolerance_m = flown.traffic.config().tolerance_m;
    let arrives = (200.0 - 0.5 * tolerance_m) / 2.0;
    let quiet = flown.traffic.undisturbed_s(&flies(east(2.0))).expect("it flies straight");
    assert_abs_diff_eq!(quiet, arrives, epsilon = 1e-9);
    // Elsewhere than it was sent, or one that should rest.
    assert_eq!(flown.traffic.undisturbed_s(&flies(Vector3::new(2.0, 0.1, 0.0))), None);
    let drifts = [(places[0], east(2.0)), (places[1], east(0.1))];
    assert_eq!(flown.traffic.undisturbed_s(&drifts), None);
    // Another one waits for the line.
    flown.traffic.go(1, &at(10.0, 10.0)).expect("there are two");
    let _ = flown.traffic.step();
    let released = 0.25 * flown.traffic.config().keep_m() / 2.0;
    let quiet = flown.traffic.undisturbed_s(&flies(east(2.0))).expect("it flies straight");
    assert_abs_diff_eq!(quiet, released, epsilon = 1e-9);
}

#[test]
fn resting_drones_are_flown_around() {
    let mut flown = Flown::new(&AirspaceConfig::default(), &[at(0.0, 0.0), at(10.0, 0.5)]);
    flown.traffic.go(0, &at(20.0, 0.0)).expect("there are two");
    flown.settle();
    assert!((flown.places[0] - at(20.0, 0.0)).norm() < 0.5);
    assert!((2.0..3.5).contains(&flown.least), "{}", flown.least);
    assert_eq!(flown.traffic.status(1), Travel::There);
    assert!(flown.reasons(1).is_empty());
}

/// A corridor in which nobody can pass.
fn corridor() -> AirspaceConfig {
    AirspaceConfig {
        fence_m: vec![[0.0, 0.0], [30.0, 0.0], [30.0, 3.0], [0.0, 3.0]],
        ..AirspaceConfig::default()
    }
}

#[test]
fn a_formation_exchanges_what_is_in_the_way() {
    let mut flown = Flown::new(&corridor(), &[at(5.0, 1.5), at(12.0, 1.5)]);
    flown.traffic.depart(&formation(&[at(25.0, 1.5), at(2.0, 1.5)])).expect("there are two");
    flown.settle();
    assert!((flown.places[0] - at(2.0, 1.5)).norm() < 0.5);
    assert!((flown.places[1] - at(25.0, 1.5)).norm() < 0.5);
    assert_eq!(flown.traffic.goal(0), Some(at(2.0, 1.5)));
    assert!(flown.orders.iter().any(|o| matches!(o.reason, OrderReason::Exchanged { .. })));
}

#[test]
fn goals_of_their_own_are_not_exchanged() {
    let mut flown = Flown::new(&corridor(), &[at(5.0, 1.5), at(12.0, 1.5)]);
    flown.traffic.go(0, &at(28.0, 1.5)).expect("there are two");
    flown.traffic.go(1, &at(2.0, 1.5)).expect("there are two");
    flown.settle();
    assert_eq!([0, 1].map(|d| flown.traffic.status(d)), [Travel::Blocked; 2]);
    assert!(flown.least >= 2.0);
    // Until somebody is sent somewhere that is possible.
    flown.traffic.go(0, &at(2.0, 1.5)).expect("there are two");
    flown.traffic.go(1, &at(28.0, 1.5)).expect("there are two");
    flown.settle();
    assert_eq!([0, 1].map(|d| flown.traffic.status(d)), [Travel::There; 2]);
}

#[test]
fn a_ring_turns_though_each_stands_in_the_way_of_the_next() {
    // 8 drones, 3.4 m from one to the next; every goal is 1.7 m from two of them.
    let ring = |turn: f64| -> Vec<Vector3<f64>> {
        let place = |index: u32| {
            let angle = std::f64::consts::TAU / 8.0 * (f64::from(index) + turn);
            at(4.45 * angle.cos(), 4.45 * angle.sin())
        };
        (0..8).map(place).collect()
    };
    let mut flown = Flown::new(&AirspaceConfig::default(), &ring(0.0));
    let drones: Vec<usize> = (0..8).collect();
    let turned = flown.traffic.form(&drones, &ring(0.5)).expect("there are eight");
    assert!(turned.moved.is_empty());
    flown.traffic.depart(&turned).expect("there are eight");
    flown.settle();
    assert!(flown.least >= 2.0, "{}", flown.least);
    assert!(flown.orders.iter().any(|o| o.reason == OrderReason::Aside));
    for drone in drones {
        assert_eq!(flown.traffic.status(drone), Travel::There, "drone {drone}");
    }
}

#[test]
fn one_that_is_held_stops_and_others_go_on() {
    let mut flown = Flown::new(&AirspaceConfig::default(), &[at(0.0, 0.0), at(20.0, 0.0)]);
    flown.traffic.go(0, &at(40.0, 30.0)).expect("there are two");
    flown.traffic.go(1, &at(0.0, 30.0)).expect("there are two");
    for _ in 0..20 {
        flown.step(&[]);
    }
    flown.traffic.hold(0).expect("there are two");
    flown.step(&[]);
    assert_eq!(flown.reasons(0).last(), Some(&OrderReason::Stop));
    flown.settle();
    let flown_on = flown.places[0].xy().norm();
    assert!((2.0..3.2).contains(&flown_on), "a metre to stop, no more: {flown_on}");
    assert!((flown.places[1] - at(0.0, 30.0)).norm() < 0.5);
    assert_eq!(flown.traffic.goal(0), None);
}

#[test]
fn a_silent_drone_keeps_its_line_though_it_is_held() {
    let mut flown = Flown::new(&AirspaceConfig::default(), &[at(0.0, 0.0), at(10.0, 10.0)]);
    flown.traffic.go(0, &at(20.0, 0.0)).expect("there are two");
    flown.step(&[]);
    flown.traffic.hold(0).expect("there are two");
    flown.traffic.go(1, &at(10.0, -10.0)).expect("there are two");
    for _ in 0..50 {
        flown.step(&[0]);
    }
    // Nobody knows whether it has flown on; the way around is longer than worth it.
    assert_eq!(flown.traffic.status(1), Travel::Waiting);
    flown.step(&[]);
    flown.settle();
    assert!((flown.places[1] - at(10.0, -10.0)).norm() < 0.5);
}

#[test]
fn an_order_that_was_not_accepted_is_given_again() {
    let mut flown = Flown::new(&AirspaceConfig::default(), &[at(0.0, 0.0)]);
    flown.traffic.go(0, &at(20.0, 0.0)).expect("there is one");
    let first = flown.traffic.step();
    assert_eq!(first.len(), 1);
    assert_eq!(flown.traffic.step(), []);
    flown.traffic.repeat(0).expect("there is one");
    assert_eq!(flown.traffic.step(), [], "nobody knows where it is by now");
    flown.traffic.locate(0, &at(0.0, 0.0));
    assert_eq!(flown.traffic.step(), first);
    flown.traffic.repeat(0).expect("there is one");
    flown.settle();
    assert!((flown.places[0] - at(20.0, 0.0)).norm() < 0.5);
}

#[test]
fn one_that_begins_too_near_flies_away_but_not_nearer() {
    // Lines keep 3 m, the drones begin 2.2 m apart.
    let mut flown = Flown::new(&AirspaceConfig::default(), &[at(0.0, 0.0), at(2.2, 0.0)]);
    flown.traffic.go(0, &at(10.0, 0.0)).expect("there are two");
    flown.traffic.go(1, &at(12.0, 5.0)).expect("there are two");
    flown.settle();
    assert!(flown.least >= 2.2 - 1e-9, "{}", flown.least);
    assert_eq!([0, 1].map(|d| flown.traffic.status(d)), [Travel::There; 2]);
}

#[test]
fn one_that_the_wind_moves_is_taken_from_there() {
    let mut flown = Flown::new(&AirspaceConfig::default(), &[at(0.0, 0.0), at(10.0, 20.0)]);
    flown.traffic.go(0, &at(20.0, 0.0)).expect("there are two");
    for _ in 0..100 {
        flown.step(&[]);
    }
    flown.places[0].y = 5.0;
    flown.step(&[]);
    assert_abs_diff_eq!(flown.traffic.place(0).expect("it is there").y, 5.0, epsilon = 0.1);
    flown.traffic.go(1, &at(10.0, 4.0)).expect("there are two");
    flown.settle();
    assert!((flown.places[0] - at(20.0, 0.0)).norm() < 0.5);
    assert!((flown.places[1] - at(10.0, 4.0)).norm() < 0.5);
    assert!(flown.least >= 2.0, "{}", flown.least);
    // A resting one flies back.
    flown.places[0].y = -3.0;
    flown.step(&[]);
    assert_eq!(flown.traffic.status(0), Travel::UnderWay);
    flown.settle();
    assert!((flown.places[0] - at(20.0, 0.0)).norm() < 0.5);
}

#[test]
fn the_band_is_entered_and_left_straight_up_and_down() {
    let config = AirspaceConfig { altitude_m: Some([3.0, 10.0]), ..corner() };
    let ground = Vector3::new(5.0, 5.0, 0.0);
    let mut flown = Flown::new(&config, &[ground]);
    flown.traffic.go(0, &at(15.0, 5.0)).expect("there is one");
    flown.settle();
    assert_eq!(flown.orders[0].to, Vector3::new(5.0, 5.0, 3.0));
    assert!((flown.places[0] - at(15.0, 5.0)).norm() < 0.5);
    flown.traffic.go(0, &ground).expect("there is one");
    flown.settle();
    assert_eq!(flown.traffic.status(0), Travel::Blocked, "below the band");
    flown.traffic.recall(0, &ground).expect("there is one");
    flown.settle();
    assert!((flown.places[0] - ground).norm() < 0.5);
    let last = flown.orders.iter().rev().take(2).map(|o| o.to).collect::<Vec<_>>();
    assert_eq!(last, [ground, Vector3::new(5.0, 5.0, 3.0)]);
}

#[test]
fn a_walled_off_goal_is_blocked() {
    let wall =
        KeepOut::Polygon { corners_m: vec![[14.0, -1.0], [16.0, -1.0], [16.0, 4.0], [14.0, 4.0]] };
    let config = AirspaceConfig { keep_out: vec![wall], ..corridor() };
    let mut flown = Flown::new(&config, &[at(5.0, 1.5)]);
    flown.traffic.go(0, &at(25.0, 1.5)).expect("there is one");
    flown.settle();
    assert_eq!(flown.traffic.status(0), Travel::Blocked);
    assert!(flown.orders.is_empty());
}

#[test]
fn nonsense_is_refused_by_name() {
    let airspace = Airspace::new(&corner()).expect("an airspace");
    let new = |config, places: &[Vector3<f64>]| Traffic::new(&airspace, config, places);
    let refused = |config, places: &[Vector3<f64>]| new(config, places).expect_err("nonsense");
    let config = TrafficConfig::default();
    assert_eq!(
        refused(config, &[at(1.0, 1.0), at(9.0, 9.0), at(2.5, 1.0)]),
        TrafficError::TooNear { first: 0, second: 2, distance_m: 1.5, separation_m: 2.0 }
    );
    let outside = refused(config, &[at(1.0, 1.0), at(15.0, 15.0)]);
    assert_eq!(outside, TrafficError::Outside { drone: 1, east: 15.0, north: 15.0, up: 4.0 });
    // A mast may be higher than drones may fly, and stands inside of the fence all the same.
    let low = Airspace::new(&AirspaceConfig { altitude_m: Some([1.5, 1.5]), ..corner() });
    let low = low.expect("an airspace");
    let mast = |east, rooted: bool| {
        Traffic::with_rooted(&low, config, &[at(east, 1.0)], |_| rooted).map(|_| ())
    };
    let too_high = TrafficError::Outside { drone: 0, east: 1.0, north: 1.0, up: 4.0 };
    assert_eq!(mast(1.0, false), Err(too_high));
    assert_eq!(mast(1.0, true), Ok(()));
    assert!(matches!(mast(150.0, true), Err(TrafficError::Outside { .. })));
    let nowhere = refused(config, &[at(1.0, f64::NAN)]);
    assert!(matches!(nowhere, TrafficError::NotFinite { drone: 0, .. }));
    let field = |config| match refused(config, &[]) {
        TrafficError::Parameter(error) => error.name,
        other => panic!("{other}"),
    };
    assert_eq!(field(TrafficConfig { separation_m: 0.0, ..config }), "separation_m");
    assert_eq!(field(TrafficConfig { tolerance_m: f64::NAN, ..config }), "tolerance_m");
    assert_eq!(field(TrafficConfig { stopping_m: -1.0, ..config }), "stopping_m");
    let void = Some(Void { radius_m: 3.0, probability: 1.0 });
    assert_eq!(field(TrafficConfig { void, ..config }), "void.probability");
    let wide = TrafficConfig { tolerance_m: 6.0, ..config };
    assert!(matches!(refused(wide, &[at(1.0, 1.0)]), TrafficError::Airspace(_)));

    let mut traffic = new(config, &[at(1.0, 1.0)]).expect("one drone");
    assert_eq!(traffic.go(1, &at(1.0, 1.0)), Err(TrafficError::Drone { drone: 1, drones: 1 }));
    assert!(traffic.go(0, &at(f64::INFINITY, 1.0)).is_err());
    assert!(traffic.hold(1).is_err() && traffic.repeat(1).is_err());
    traffic.locate(0, &at(f64::NAN, 1.0));
    traffic.locate(7, &at(5.0, 1.0));
    assert_eq!(traffic.place(0), Some(at(1.0, 1.0)));
    assert_eq!((traffic.place(1), traffic.goal(1)), (None, None));
}

#[test]
fn files_are_read_as_written() {
    use foxhunt_formation::EnduranceConfig;

    let text = r#"{ "separation_m": 3, "void": { "radius_m": 10, "probability": 0.05 } }"#;
    let config: TrafficConfig = serde_json::from_str(text).expect("it is written so");
    let void = Some(Void { radius_m: 10.0, probability: 0.05 });
    assert_eq!(config, TrafficConfig { separation_m: 3.0, void, ..TrafficConfig::default() });
    assert_abs_diff_eq!(config.keep_m(), 4.0, epsilon = 1e-12);
    assert!(serde_json::from_str::<TrafficConfig>(r#"{ "separation": 3 }"#).is_err());
    assert!(serde_json::from_str::<TrafficConfig>(r#"{ "void": { "radius_m": 3 } }"#).is_err());
    let config: EnduranceConfig = serde_json::from_str(r#"{ "reserve_s": 60 }"#).expect("so");
    assert_eq!(config, EnduranceConfig { reserve_s: 60.0, ..EnduranceConfig::default() });
    assert!(serde_json::from_str::<EnduranceConfig>(r#"{ "reserve": 60 }"#).is_err());
}
