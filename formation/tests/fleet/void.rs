//! Keeping away from targets.

use foxhunt_core::{Belief, Estimate};
use foxhunt_formation::{AirspaceConfig, Endurance, EnduranceConfig, TrafficConfig, Travel, Void};
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

#[test]
fn the_way_around_a_target_counts_on_the_way_out() {
    let belief = Estimate::isotropic(Vector2::new(50.0, 0.0), 3.0);
    let void = Void { radius_m: 20.0, probability: 0.1 };
    let endurance = Endurance::new(EnduranceConfig::default()).expect("the default is in range");
    let round = |void| {
        let config = TrafficConfig { void, ..TrafficConfig::default() };
        let mut flown = Flown::with(&AirspaceConfig::default(), config, &[at(0.0, 0.0)]);
        flown.traffic.believe([&belief as &dyn Belief]);
        let formation = flown.traffic.form(&[0], &[at(100.0, 0.0)]).expect("one drone");
        let needed_s = endurance
            .round_s(&flown.traffic, &formation, &[at(0.0, 0.0)], 0.0)
            .expect("there is a way");
        flown.traffic.depart(&formation).expect("there is one");
        flown.settle();
        assert_eq!(flown.traffic.status(0), Travel::There);
        let out_s = std::mem::take(&mut flown.seconds);
        flown.traffic.recall(0, &at(0.0, 0.0)).expect("there is one");
        flown.settle();
        (needed_s, out_s, flown.seconds)
    };
    // There and back 100 m at 2 m/s, with two metres for stopping.
    let (needed_s, ..) = round(None);
    assert!((needed_s - 102.0).abs() < 1e-9, "{needed_s}");
    let (needed_s, out_s, home_s) = round(Some(void));
    assert!(out_s > 52.0, "around: {out_s}");
    assert!(home_s < 51.0, "straight: {home_s}");
    assert!(needed_s > out_s + home_s, "{needed_s}, not {out_s} and {home_s}");
    assert!(needed_s < out_s + home_s + 4.0, "{needed_s}");
}
