//! Drones that begin on an edge of the airspace.

use foxhunt_formation::{Airspace, AirspaceConfig, KeepOut, OrderReason, Travel};
use nalgebra::{Vector2, Vector3};

use crate::{
    airspace::corner,
    flown::{Flown, at},
};

/// The corner with two zones in its southern part.
fn edges() -> AirspaceConfig {
    AirspaceConfig {
        keep_out: vec![
            KeepOut::Disc { centre_m: [3.0, 5.0], radius_m: 1.0 },
            KeepOut::Polygon { corners_m: vec![[13.0, 3.0], [15.0, 3.0], [14.0, 5.0]] },
        ],
        ..corner()
    }
}

/// Flies from one place to another and returns the least clearance on the way.
fn fly(from: Vector3<f64>, to: Vector3<f64>) -> (Flown, f64) {
    let airspace = Airspace::new(&edges()).expect("an airspace");
    let mut flown = Flown::new(&edges(), &[from]);
    flown.traffic.go(0, &to).expect("there is one");
    let mut least = f64::INFINITY;
    for _ in 0..1000 {
        flown.step(&[]);
        least = least.min(airspace.clearance(&flown.places[0].xy()));
    }
    (flown, least)
}

#[test]
fn one_that_begins_on_an_edge_flies_off_it() {
    let goal = at(8.0, 8.0);
    let disc = Vector2::new(3.0, 5.0) + Vector2::new(0.6, -0.8);
    let slanted = Vector2::new(13.0, 3.0).lerp(&Vector2::new(14.0, 5.0), 0.3);
    let starts = [
        ("a side", at(0.0, 11.0)),
        ("a corner", at(0.0, 0.0)),
        ("a corner that sticks in", at(10.0, 10.0)),
        ("the side next to it", at(15.0, 10.0)),
        ("a disc", at(disc.x, disc.y)),
        ("a polygon's side", at(slanted.x, slanted.y)),
        ("a polygon's southern side", at(14.0, 3.0)),
        ("a polygon's corner", at(14.0, 5.0)),
    ];
    for (name, start) in starts {
        let (flown, least) = fly(start, goal);
        assert_eq!(flown.traffic.status(0), Travel::There, "{name}");
        assert!((flown.places[0] - goal).norm() < 0.5, "{name}");
        assert!(least >= -1e-9, "{name}: {least}");
    }
}

#[test]
fn one_that_begins_on_an_edge_crosses_nothing() {
    // A disc is straight ahead, and then the missing quarter.
    for (start, goal) in [(at(0.0, 5.0), at(8.0, 5.0)), (at(10.0, 20.0), at(19.0, 9.0))] {
        let (flown, least) = fly(start, goal);
        assert_eq!(flown.traffic.status(0), Travel::There);
        assert_eq!(flown.orders[0].reason, OrderReason::Around);
        assert!(least >= -1e-9, "{least}");
    }
}
