//! Drones that are not counted on any more.

use foxhunt_formation::{AirspaceConfig, OrderReason, Travel};

use crate::flown::{Flown, at};

/// The first drone is stuck in the middle of its way, across that of the second.
fn stuck(airspace: &AirspaceConfig) -> Flown {
    let mut flown = Flown::new(airspace, &[at(0.0, 0.0), at(20.0, 0.0)]);
    flown.traffic.go(0, &at(20.0, 20.0)).expect("there are two");
    flown.traffic.go(1, &at(0.0, 20.0)).expect("there are two");
    for _ in 0..140 {
        flown.step(&[]);
    }
    // It is located where it is, it is ordered to stop, and it neither moves nor arrives.
    flown.traffic.hold(0).expect("there are two");
    for _ in 0..1000 {
        flown.step(&[0]);
        let place = flown.places[0];
        flown.traffic.locate(0, &place);
    }
    flown
}

/// So narrow that nobody gets past the middle.
fn narrow() -> AirspaceConfig {
    AirspaceConfig {
        fence_m: vec![
            [-1.0, -1.0],
            [21.0, -1.0],
            [21.0, 3.0],
            [12.0, 10.0],
            [21.0, 17.0],
            [21.0, 21.0],
            [-1.0, 21.0],
            [-1.0, 17.0],
            [8.0, 10.0],
            [-1.0, 3.0],
        ],
        ..AirspaceConfig::default()
    }
}

#[test]
fn others_do_not_wait_for_one_that_was_given_up() {
    let mut flown = stuck(&narrow());
    let reserved = flown.traffic.reserved(0).to_vec();
    assert_eq!(flown.traffic.status(1), Travel::Waiting);
    flown.traffic.give_up(0).expect("there are two");
    flown.step(&[0]);
    assert_eq!([0, 1].map(|d| flown.traffic.status(d)), [Travel::There, Travel::Blocked]);
    assert_eq!(flown.traffic.reserved(0), reserved, "it keeps its region");
    assert_eq!(flown.traffic.goal(0), None);
    // It is counted on again as soon as it is sent somewhere.
    flown.traffic.go(0, &at(20.0, 20.0)).expect("there are two");
    flown.step(&[0]);
    assert_eq!(flown.traffic.status(0), Travel::UnderWay);
    flown.settle();
    assert_eq!([0, 1].map(|d| flown.traffic.status(d)), [Travel::There; 2]);
    assert!(flown.least >= 2.0, "{}", flown.least);
}

#[test]
fn others_fly_around_one_that_was_given_up_and_around_what_it_may_still_fly() {
    let mut flown = Flown::new(&AirspaceConfig::default(), &[at(0.0, 0.0), at(20.0, 10.0)]);
    flown.traffic.go(0, &at(40.0, 0.0)).expect("there are two");
    for _ in 0..100 {
        flown.step(&[]);
    }
    flown.traffic.go(1, &at(20.0, -10.0)).expect("there are two");
    for _ in 0..100 {
        flown.step(&[0]);
    }
    assert_eq!(flown.traffic.status(1), Travel::Waiting);
    flown.traffic.give_up(0).expect("there are two");
    flown.step(&[0]);
    assert_eq!(flown.traffic.status(1), Travel::UnderWay);
    let around = flown.traffic.reserved(1).iter().any(|p| p.x > 42.9 || p.x < 7.1);
    assert!(around, "{:?}", flown.traffic.reserved(1));
    // It got no order: it flies on to where it was sent.
    flown.settle();
    flown.settle();
    assert!((flown.places[1] - at(20.0, -10.0)).norm() < 0.5);
    assert!((flown.places[0] - at(40.0, 0.0)).norm() < 0.5);
    assert!(flown.least >= 2.0, "{}", flown.least);
}

#[test]
fn one_that_has_landed_gets_no_orders() {
    let mut flown = Flown::new(&AirspaceConfig::default(), &[at(0.0, 0.0)]);
    flown.traffic.go(0, &at(20.0, 0.0)).expect("there is one");
    flown.traffic.give_up(0).expect("there is one");
    flown.step(&[]);
    assert_eq!(flown.orders, [], "it had not been sent yet");
    assert_eq!(flown.traffic.reserved(0), [at(0.0, 0.0)]);
    // The wind takes it; one that is not given up would be ordered to return.
    for east in [1.0, 3.0] {
        flown.traffic.locate(0, &at(east, 0.0));
        assert_eq!(flown.traffic.step(), []);
        assert_eq!(flown.traffic.place(0), Some(at(east, 0.0)));
    }
    // But for a stop that it has not been ordered yet.
    flown.places[0] = at(3.0, 0.0);
    flown.traffic.go(0, &at(20.0, 0.0)).expect("there is one");
    flown.step(&[]);
    flown.traffic.hold(0).expect("there is one");
    flown.traffic.give_up(0).expect("there is one");
    flown.step(&[]);
    assert_eq!(flown.reasons(0), [OrderReason::Straight, OrderReason::Stop]);
    assert!(flown.traffic.give_up(1).is_err());
}
