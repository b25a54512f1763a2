//! Keeping away from targets.

use foxhunt_core::{Belief, Estimate};
use foxhunt_formation::{AirspaceConfig, TrafficConfig, Travel, Void};
use nalgebra::Vector2;

use crate::flown::{Flown, at};

#[test]
fn targets_are_flown_around_but_not_on_the_way_home() {
    let belief = Estimate::isotropic(Vector2::new(20.0, 1.0), 3.0);
    let void = Void { radius_m: 8.0, probability: 0.1 };
    let config = TrafficConfig { void: Some(void), ..TrafficConfig::default() };
    let start = at(0.0, 0.0);
    let mut flown = Flown::with(&AirspaceConfig::default(), config, &[start]);
    flown.traffic.believe([&belief as &dyn Belief]);
    flown.traffic.go(0, &at(40.0, 0.0)).expect("there is one");
    let nearest = |flown: &Flown| {
        let mut nearest = f64::INFINITY;
        belief.visit_positions(&mut |place, weight| {
            assert!(weight > 0.1, "each of four samples is too much");
            for leg in flown.traffic.reserved(0).windows(2) {
                for k in 0..=200 {
                    let here = leg[0].xy().lerp(&leg[1].xy(), f64::from(k) / 200.0);
                    nearest = f64::min(nearest, (place - here).norm());
                }
            }
        });
        nearest
    };
    flown.step(&[]);
    assert!(nearest(&flown) >= 8.0, "{}", nearest(&flown));
    flown.settle();
    assert_eq!(flown.traffic.status(0), Travel::There);
    flown.traffic.recall(0, &start).expect("there is one");
    flown.step(&[]);
    assert!(nearest(&flown) < 8.0);
    flown.settle();
    // One that is inside already may fly out.
    let here = Estimate::isotropic(Vector2::new(0.0, 0.5), 3.0);
    flown.traffic.believe([&here as &dyn Belief]);
    flown.traffic.go(0, &at(40.0, 0.0)).expect("there is one");
    flown.settle();
    assert_eq!(flown.traffic.status(0), Travel::There);
}
