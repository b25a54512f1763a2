use approx::assert_abs_diff_eq;
use std::f64::consts::{PI, TAU};

use foxhunt::{
    core::Rotator,
    hardware::{Approach, BeyondCable, FirmataConfig, FirmataStepperError},
    sim::EmulatedStepperConfig,
};

use super::rig::{Rig, half_step};

/// One turn to and one fro.
fn to_and_fro() -> impl Iterator<Item = f64> {
    let positions = (0..128).chain((0..128).rev());
    positions.map(|position| TAU * f64::from(position) / 128.0)
}

#[test]
fn every_position_is_within_half_a_half_step() {
    for approach in [Approach::OneSided, Approach::Compensated] {
        // What is compensated has to be known well.
        let backlash_deg = if approach == Approach::Compensated { 3.0 } else { 6.0 };
        let config = FirmataConfig { approach, backlash_deg, ..FirmataConfig::default() };
        let mut rig = Rig::new(config, EmulatedStepperConfig::default());
        // The play itself is rounded to steps where it is compensated.
        let allowed = if approach == Approach::Compensated { 1.0 } else { 0.5 } * half_step();
        for angle in to_and_fro() {
            let (reported, truth) = rig.turn(angle);
            assert!((truth - angle).abs() < allowed + 1e-9, "{approach:?}: {truth}, not {angle}");
            assert_abs_diff_eq!(reported, truth, epsilon = half_step() * 0.5 + 1e-9);
        }
    }
}

#[test]
fn without_an_approach_from_one_side_the_play_shows() {
    let config = FirmataConfig { backlash_deg: 0.0, ..FirmataConfig::default() };
    let mut rig = Rig::new(config, EmulatedStepperConfig::default());
    rig.turn(1.0);
    let (reported, truth) = rig.turn(0.5);
    assert_abs_diff_eq!(truth - reported, 3.0_f64.to_radians(), epsilon = half_step());
}

#[test]
fn a_thousand_turns_do_not_drift() {
    let config = FirmataConfig {
        cable_turns: f64::INFINITY,
        speed_half_steps_per_s: 50_000.0,
        ..FirmataConfig::default()
    };
    let mut rig = Rig::new(config, EmulatedStepperConfig::default());
    for turn in (0..=1000).step_by(25).chain((0..1000).rev().step_by(125)) {
        let angle = TAU * f64::from(turn) + 0.1;
        let (_, truth) = rig.turn(angle);
        assert!((truth - angle).abs() < half_step() * 0.5 + 1e-7, "turn {turn}: {truth}");
    }
}

#[test]
fn counts_stay_below_what_the_arduino_loses() {
    let config = FirmataConfig {
        cable_turns: f64::INFINITY,
        speed_half_steps_per_s: 80_000.0,
        ..FirmataConfig::default()
    };
    let mut rig = Rig::new(config, EmulatedStepperConfig::default());
    rig.tick_s = 1.0;
    // 1.2·10⁸ half steps each; the third would be beyond 2²⁸.
    for turns in [30_000.0, 60_000.0, 90_000.0, 90_000.25] {
        rig.driver.turn_to(TAU * turns).expect("it is accepted");
        rig.wait(5000.0).expect("it comes there");
        let error = (rig.truth() - TAU * turns).abs();
        assert!(error < half_step() * 0.5 + 1e-5, "{turns}: {error}");
    }
    let far = rig.driver.turn_to(TAU * 200_000.0);
    assert!(matches!(far, Err(FirmataStepperError::TooFar { .. })), "{far:?}");
}

#[test]
fn orders_beyond_the_cable_unwind_it_or_are_refused() {
    let mut rig = Rig::new(FirmataConfig::default(), EmulatedStepperConfig::default());
    rig.turn(TAU * 0.9);
    let (reported, _) = rig.turn(TAU * 1.1);
    assert_abs_diff_eq!(reported, TAU * 0.1, epsilon = half_step());
    rig.turn(TAU * 0.75);
    rig.driver.unwind().expect("it is accepted");
    let reported = rig.wait(60.0).expect("it comes there");
    assert_abs_diff_eq!(reported + TAU * 0.25, 0.0, epsilon = half_step());

    let beyond_cable = BeyondCable::Refuse;
    let config = FirmataConfig { beyond_cable, ..FirmataConfig::default() };
    let mut rig = Rig::new(config, EmulatedStepperConfig::default());
    rig.turn(TAU);
    let refused = rig.driver.turn_to(TAU * 1.1).expect_err("the cable is too short").to_string();
    assert!(refused.contains("1.10 turns"), "{refused}");
    let refused = rig.driver.turn_to(f64::NAN);
    assert!(matches!(refused, Err(FirmataStepperError::Angle { .. })), "{refused:?}");
    let reported = rig.wait(1.0).expect("it still stands");
    assert_abs_diff_eq!(reported, TAU, epsilon = half_step());
}

#[test]
fn a_motor_that_turns_clockwise_is_turned_the_other_way() {
    let config = FirmataConfig { clockwise: true, ..FirmataConfig::default() };
    // The coils taken in the other order: the first pin leads to IN4, half step 6.
    let pins = [11, 10, 9, 8];
    let phase = 6;
    let mut rig = Rig::new(config, EmulatedStepperConfig { pins, phase, ..Default::default() });
    for angle in [1.0, 0.5, -0.5, 2.0] {
        let (reported, truth) = rig.turn(angle);
        // Pushed forwards by the motor is now pulled backwards by the gear: the play is on the
        // other side.
        let play = 3.0_f64.to_radians();
        assert_abs_diff_eq!(reported, angle, epsilon = half_step());
        assert_abs_diff_eq!(truth - angle, play, epsilon = half_step());
    }
}

#[test]
fn a_newer_order_is_followed_at_once() {
    let acceleration = 1000.0;
    for acceleration_half_steps_per_s2 in [0.0, acceleration] {
        let config = FirmataConfig { acceleration_half_steps_per_s2, ..FirmataConfig::default() };
        let mut rig = Rig::new(config, EmulatedStepperConfig::default());
        rig.turn(0.0);
        for (first, second) in [(3.0, 1.0), (0.0, 2.0), (3.0, -1.0), (PI, 3.0)] {
            rig.driver.turn_to(first).expect("it is accepted");
            for _ in 0..30 {
                assert_eq!(rig.tick().expect("nothing fails"), None, "it turns");
            }
            let (reported, truth) = rig.turn(second);
            assert_abs_diff_eq!(reported, second, epsilon = half_step());
            assert_abs_diff_eq!(truth, reported, epsilon = 1e-9);
        }
    }
}
