use approx::assert_abs_diff_eq;
use core::f64::consts::{FRAC_PI_2, PI};

use foxhunt_core::{
    BeaconId, Bearing, Decision, Estimate, FormationPlanner, Level, Outcome, PlanError, Pose,
    Reception, Station, Target, laws,
};
use nalgebra::{Vector2, Vector3};

use super::{SurgeCast, SurgeCastConfig};
use crate::planners::fake::{Shrinking, arrive, stations};

fn planner() -> SurgeCast {
    SurgeCast::new(SurgeCastConfig::default()).expect("the defaults are in range")
}

fn reception(beacon: u16, rss_dbm: f64, bearing: Option<f64>) -> Reception {
    Reception {
        beacon: BeaconId(beacon),
        level: Some(Level { rss_dbm, sigma_db: 2.0 }),
        bearing: bearing.map(|angle| Bearing { angle, sigma: 0.2, confidence: 1.0 }),
        ..Reception::default()
    }
}

/// Something new that is believed of a far place.
fn far(sigma: f64) -> Estimate<2> {
    Estimate::isotropic(Vector2::new(500.0, 0.0), sigma)
}

#[test]
fn it_surges_while_the_level_rises_and_casts_when_it_falls() {
    let mut drone = [Station::holding(Pose::at(0.0, 0.0, 4.0))];
    let mut planner = planner();
    planner.begin(&mut drone).expect("a drone");
    // Along the bearing, North, and not to the estimate, East; then cast left, right and farther
    // left of where the level was last high.
    let steps = [
        (-80.0, Some(FRAC_PI_2), (0.0, 20.0)),
        (-75.0, Some(FRAC_PI_2), (0.0, 40.0)),
        (-76.0, Some(FRAC_PI_2), (0.0, 60.0)),
        (-79.0, Some(FRAC_PI_2), (-8.0, 40.0)),
        (-79.5, None, (12.0, 40.0)),
        (-79.0, Some(0.0), (-18.0, 40.0)),
        // Found again: on from here, along the bearing of now.
        (-77.0, Some(PI), (-38.0, 40.0)),
    ];
    // At the start the level of the third step was −76, from which −79 is a fall.
    for (step, (level, bearing, (east, north))) in steps.into_iter().enumerate() {
        arrive(&mut drone);
        planner.observe(&reception(0, level, bearing));
        let sigma = 100.0 - crate::shape::number(step);
        planner.plan(&far(sigma), &mut drone).expect("a place");
        let place = drone[0].goal.position.xy();
        let expected = Vector2::new(east, north);
        assert!((place - expected).norm() < 1e-9, "step {step}: {place}");
    }
}

#[test]
fn without_a_signal_it_turns_to_the_estimate() {
    let mut drone = [Station::holding(Pose::at(0.0, 0.0, 4.0))];
    let mut planner = planner();
    planner.begin(&mut drone).expect("a drone");
    planner.observe(&reception(0, -80.0, Some(FRAC_PI_2)));
    planner.plan(&far(90.0), &mut drone).expect("a place");
    for cast in 0..4 {
        arrive(&mut drone);
        planner.plan(&far(80.0 - f64::from(cast)), &mut drone).expect("a place");
        assert!(drone[0].goal.position.y.abs() < 1e-9, "cast {cast} is not across");
    }
    arrive(&mut drone);
    let here = drone[0].pose.position;
    // A bearing that comes with so low a level is not followed.
    planner.observe(&reception(0, -95.0, Some(FRAC_PI_2)));
    planner.plan(&far(70.0), &mut drone).expect("a place");
    let moved: Vector3<f64> = drone[0].goal.position - here;
    assert_abs_diff_eq!(moved.x, 20.0, epsilon = 1e-3);
    assert_abs_diff_eq!(moved.y, 0.0, epsilon = 1.0);
}

#[test]
fn after_the_last_cast_a_level_that_is_high_again_is_followed() {
    let mut drone = [Station::holding(Pose::at(0.0, 0.0, 4.0))];
    let mut planner = planner();
    planner.begin(&mut drone).expect("a drone");
    planner.observe(&reception(0, -80.0, Some(FRAC_PI_2)));
    planner.plan(&far(90.0), &mut drone).expect("a place");
    for cast in 0..4 {
        arrive(&mut drone);
        planner.plan(&far(80.0 - f64::from(cast)), &mut drone).expect("a place");
    }
    arrive(&mut drone);
    let here = drone[0].pose.position;
    planner.observe(&reception(0, -75.0, Some(FRAC_PI_2)));
    planner.plan(&far(70.0), &mut drone).expect("a place");
    let moved: Vector3<f64> = drone[0].goal.position - here;
    assert_abs_diff_eq!(moved.y, 20.0, epsilon = 1e-9);
    assert_abs_diff_eq!(moved.x, 0.0, epsilon = 1e-9);
}

#[test]
fn a_sure_bearing_counts_for_more() {
    let mut drone = [Station::holding(Pose::at(0.0, 0.0, 4.0))];
    let mut planner = planner();
    planner.begin(&mut drone).expect("a drone");
    let mut sure = reception(0, -80.0, Some(FRAC_PI_2));
    sure.bearing = Some(Bearing { angle: FRAC_PI_2, sigma: 0.1, confidence: 1.0 });
    planner.observe(&sure);
    planner.observe(&reception(0, -80.0, Some(0.0)));
    planner.plan(&far(90.0), &mut drone).expect("a place");
    // Four times the weight of the one to the East.
    let to = drone[0].goal.position;
    assert_abs_diff_eq!(to.y, 4.0 * to.x, epsilon = 1e-9);
}

#[test]
fn a_bearing_without_a_level_is_followed() {
    let mut drone = [Station::holding(Pose::at(0.0, 0.0, 4.0))];
    let mut planner = planner();
    planner.begin(&mut drone).expect("a drone");
    planner.observe(&Reception { level: None, ..reception(0, -80.0, Some(FRAC_PI_2)) });
    planner.plan(&far(90.0), &mut drone).expect("a place");
    let to = drone[0].goal.position;
    assert_abs_diff_eq!(to.y, 20.0, epsilon = 1e-9);
    assert_abs_diff_eq!(to.x, 0.0, epsilon = 1e-9);
}

#[test]
fn it_goes_by_its_own_target_alone() {
    let mut drone = [Station::holding(Pose::at(0.0, 0.0, 4.0))];
    let mut planner = planner();
    planner.begin(&mut drone).expect("a drone");
    let belief = far(90.0);
    let targets = [Target { beacon: BeaconId(1), belief: &belief }];
    planner.plan_together(&targets, &mut drone).expect("a target");
    arrive(&mut drone);
    planner.observe(&reception(0, -40.0, Some(PI)));
    planner.observe(&reception(1, -80.0, Some(FRAC_PI_2)));
    let here = drone[0].pose.position;
    planner.plan_together(&targets, &mut drone).expect("a target");
    let moved = drone[0].goal.position - here;
    assert_abs_diff_eq!(moved.y, 20.0, epsilon = 1e-9);
    assert_abs_diff_eq!(moved.x, 0.0, epsilon = 1e-9);
    assert_eq!(planner.plan_together(&[], &mut drone), Err(PlanError::NoPlace));
}

#[test]
fn it_learns_which_beacon_it_follows() {
    let moved = |drone: &[Station; 1]| drone[0].goal.position - drone[0].pose.position;
    let north = |to: Vector3<f64>| (to.y - 20.0).abs() < 1e-9 && to.x.abs() < 1e-9;
    let mut drone = [Station::holding(Pose::at(0.0, 0.0, 4.0))];
    let belief = far(90.0);
    // Another one is received first, before it is known which one it follows.
    let mut planner = planner();
    planner.begin(&mut drone).expect("a drone");
    planner.observe(&reception(0, -40.0, Some(PI)));
    planner.observe(&reception(1, -80.0, Some(FRAC_PI_2)));
    let target = Target { beacon: BeaconId(1), belief: &belief };
    planner.plan_together(&[target], &mut drone).expect("a target");
    assert!(north(moved(&drone)), "{}", moved(&drone));
    // A new search that names no beacon: not that of the one before, which is still received.
    planner.begin(&mut drone).expect("a drone");
    planner.observe(&reception(1, -40.0, Some(PI)));
    planner.observe(&reception(2, -80.0, Some(FRAC_PI_2)));
    planner.plan(&belief, &mut drone).expect("a target");
    assert!(north(moved(&drone)), "{}", moved(&drone));
    // The same one again, alone.
    planner.begin(&mut drone).expect("a drone");
    planner.observe(&reception(2, -80.0, Some(FRAC_PI_2)));
    planner.plan(&belief, &mut drone).expect("a target");
    assert!(north(moved(&drone)), "{}", moved(&drone));
}

#[test]
fn it_finds_a_target_with_one_drone_and_with_several() {
    for result in [
        Shrinking::towards(120.0, 40.0).search(&mut planner(), &mut stations::<1>(), |_, _| {}),
        Shrinking::towards(120.0, 40.0).search(&mut planner(), &mut stations::<4>(), |_, _| {}),
    ] {
        assert_eq!(result.outcome, Outcome::Converged);
    }
    // One that never gets anywhere meets its cap.
    let mut stuck = stations::<1>();
    let mut planner = planner();
    planner.begin(&mut stuck).expect("a drone");
    let mut target = Shrinking::towards(120.0, 40.0);
    let decisions = (0..60).map(|_| {
        target.listen();
        planner.plan(target.estimate(), &mut stuck).expect("a place")
    });
    assert_eq!(decisions.last(), Some(Decision::Finish(Outcome::MoveLimit)));
}

#[test]
fn it_keeps_the_laws_and_refuses_bad_values() {
    laws::formation_planner(planner, &far(3.0), &mut stations::<2>());
    let good = SurgeCastConfig::default();
    for (bad, field) in [
        (SurgeCastConfig { surge_m: -1.0, ..good }, "surge_m"),
        (SurgeCastConfig { cast_growth: 0.5, ..good }, "cast_growth"),
        (SurgeCastConfig { most_casts: 0, ..good }, "most_casts"),
        (SurgeCastConfig { most_casts: 33, ..good }, "most_casts"),
        (SurgeCastConfig { step_rad: 0.0, ..good }, "step_rad"),
        (SurgeCastConfig { fall_db: f64::NAN, ..good }, "fall_db"),
    ] {
        assert_eq!(SurgeCast::new(bad).map_err(|error| error.name), Err(field));
    }
}
