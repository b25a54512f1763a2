//! Keeping away from targets.

use approx::assert_abs_diff_eq;
use foxhunt_core::{Belief, Estimate};
use foxhunt_formation::{AirspaceConfig, Endurance, EnduranceConfig, TrafficConfig, Travel, Void};
use nalgebra::{Matrix2, Vector2};

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
    // How far from the middle of the belief the way leads.
    let nearest = |flown: &Flown| {
        let legs = flown.traffic.reserved(0).windows(2);
        let places = legs.flat_map(|leg| {
            (0..=200).map(|k| leg[0].xy().lerp(&leg[1].xy(), f64::from(k) / 200.0))
        });
        places.map(|here| (here - belief.mean).norm()).fold(f64::INFINITY, f64::min)
    };
    flown.step(&[]);
    let clear = nearest(&flown);
    // A tenth of the Gaussian lies on the near side of 1.28 sigma, and the radius is 8 m.
    assert!((10.5..14.0).contains(&clear), "{clear}");
    flown.settle();
    assert_eq!(flown.traffic.status(0), Travel::There);
    flown.traffic.recall(0, &start).expect("there is one");
    flown.step(&[]);
    assert!(nearest(&flown) < 1.5);
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
    assert_abs_diff_eq!(needed_s, 102.0, epsilon = 1e-9);
    let (needed_s, out_s, home_s) = round(Some(void));
    assert!(out_s > 52.0, "around: {out_s}");
    assert!(home_s < 51.0, "straight: {home_s}");
    assert!(needed_s > out_s + home_s, "{needed_s}, not {out_s} and {home_s}");
    assert!(needed_s < out_s + home_s + 4.0, "{needed_s}");
}

/// The probability at which a drone is just permitted to rest at a place.
fn mass(belief: &Estimate<2>, place: Vector2<f64>, radius_m: f64) -> f64 {
    let (mut refused, mut permitted) = (0.0, 1.0);
    for _ in 0..12 {
        let probability = 0.5 * (refused + permitted);
        let void = Some(Void { radius_m, probability });
        let config = TrafficConfig { void, ..TrafficConfig::default() };
        let mut flown = Flown::with(&AirspaceConfig::default(), config, &[at(-90.0, 0.0)]);
        flown.traffic.believe([belief as &dyn Belief]);
        let formation = flown.traffic.form(&[0], &[at(place.x, place.y)]).expect("one drone");
        let bound = if formation.moved.is_empty() { &mut permitted } else { &mut refused };
        *bound = probability;
    }
    permitted
}

/// The Gaussian's mass within a disc, by a sum over a fine grid.
pub(crate) fn true_mass(belief: &Estimate<2>, place: Vector2<f64>, radius: f64) -> f64 {
    let precision = belief.covariance.try_inverse().expect("it is positive definite");
    let density = precision.determinant().sqrt() / std::f64::consts::TAU;
    let step = radius / 200.0;
    let axis = || (-200..=200).map(|k| f64::from(k) * step);
    let places = axis().flat_map(|x| axis().map(move |y| Vector2::new(x, y)));
    let within = places.filter(|off| off.norm() < radius);
    let at = |off: Vector2<f64>| {
        let from = place + off - belief.mean;
        (-0.5 * from.dot(&(precision * from))).exp() * density * step * step
    };
    within.map(at).sum()
}

#[test]
fn the_probability_is_that_of_the_gaussian() {
    let round = Estimate::isotropic(Vector2::new(5.0, -2.0), 3.0);
    let centre = mass(&round, round.mean, 3.0);
    assert_abs_diff_eq!(centre, 1.0 - (-0.5_f64).exp(), epsilon = 0.006);
    let long = Estimate { covariance: Matrix2::new(16.0, 6.0, 6.0, 4.0), ..round };
    for belief in [round, long] {
        for (east, north) in [(0.0, 0.0), (2.0, 1.0), (-3.0, 2.0), (4.0, -5.0), (0.0, 7.0)] {
            for radius in [2.0, 4.0, 6.0] {
                let place = belief.mean + Vector2::new(east, north);
                let (found, truth) =
                    (mass(&belief, place, radius), true_mass(&belief, place, radius));
                assert!((found - truth).abs() < 0.02, "{east}, {north}: {found}, not {truth}");
            }
        }
    }
}

/// Two heaps of ten places each, of these weights together.
struct Heaps([(Vector2<f64>, f64); 2]);

impl Belief for Heaps {
    fn position(&self) -> Estimate<2> {
        let mean = self.0[0].0 * self.0[0].1 + self.0[1].0 * self.0[1].1;
        Estimate::isotropic(mean, 20.0)
    }

    fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64)) {
        for (centre, weight) in &self.0 {
            for index in 0..10 {
                visit(&(centre + Vector2::new(0.0, 0.01 * f64::from(index))), 0.1 * weight);
            }
        }
    }
}

#[test]
fn a_long_way_out_of_one_place_does_not_lead_over_another() {
    // The drone begins in one heap; the other, which is heavier, is straight ahead.
    let ahead = Vector2::new(48.4, 0.0);
    let belief = Heaps([(Vector2::zeros(), 0.2), (ahead, 0.8)]);
    let void = Some(Void { radius_m: 1.0, probability: 0.1 });
    let config = TrafficConfig { void, ..TrafficConfig::default() };
    let mut flown = Flown::with(&AirspaceConfig::default(), config, &[at(0.0, 0.0)]);
    flown.traffic.believe([&belief as &dyn Belief]);
    flown.traffic.go(0, &at(100.0, 0.0)).expect("there is one");
    let mut nearest = f64::INFINITY;
    while flown.seconds < 120.0 {
        flown.step(&[]);
        nearest = nearest.min((flown.places[0].xy() - ahead).norm());
    }
    assert_eq!(flown.traffic.status(0), Travel::There);
    assert!(nearest > 0.99, "{nearest}");
}
