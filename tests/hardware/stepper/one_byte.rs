//! Single damaged bytes that the real firmware takes, and what the driver makes of them.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use std::f64::consts::TAU;

use foxhunt::{
    core::{Clock, Rotator},
    hardware::{FirmataConfig, FirmataStepperError, Homing},
    sim::{EmulatedStepperConfig, EmulatedSwitch, Emulator},
};

use super::rig::{FROM_DEVICE, Rig, TO_DEVICE, half_step};

/// Half steps of one of 16 positions.
const POSITION: i64 = 255;
const CONFIGURE: [u8; 11] = [0xF0, 0x62, 0, 0, 0x42, 8, 10, 9, 11, 0, 0xF7];

fn rig(config: FirmataConfig) -> Rig {
    let fastest_half_steps_per_s = Some(1100.0);
    Rig::new(config, EmulatedStepperConfig { fastest_half_steps_per_s, ..Default::default() })
}

fn plain() -> Rig {
    rig(FirmataConfig::default())
}

fn ramped() -> FirmataConfig {
    FirmataConfig {
        speed_half_steps_per_s: 1000.0,
        acceleration_half_steps_per_s2: 2000.0,
        ..FirmataConfig::default()
    }
}

/// An order to a position of the motor.
fn to(position: u16) -> Vec<u8> {
    let [low, high] = [position & 0x7F, position >> 7].map(|bits| u8::try_from(bits).expect("7"));
    vec![0xF0, 0x62, 3, 0, low, high, 0, 0, 0, 0xF7]
}

/// Turns, and waits for the true angle or for an error, which stays, and whose motor stands.
fn turn_or_fail(rig: &mut Rig, angle: f64) -> Result<f64, FirmataStepperError> {
    let ordered = rig.driver.turn_to(angle);
    let reported = ordered.and_then(|()| rig.wait(60.0));
    if let Ok(reported) = reported {
        let truth = rig.truth();
        assert_abs_diff_eq!(truth, reported, epsilon = half_step());
    } else {
        stays(rig);
    }
    reported
}

/// The motor stands from now on, but for the half second that a repeated stop takes.
fn stays(rig: &mut Rig) {
    ticks(rig, 0.5);
    let rotor = rig.device.rotor();
    ticks(rig, 10.0);
    assert_eq!(rig.device.rotor(), rotor, "it turns after an error");
}

fn ticks(rig: &mut Rig, seconds: f64) {
    let until = rig.world.clock().now() + seconds;
    while rig.world.clock().now() < until {
        let _ = rig.tick();
    }
}

#[test]
fn a_damaged_configuration_is_found_by_the_coils() {
    let damaged: [&[u8]; 4] = [
        // A pin is lost; another one is garbled; a pin is inverted; whole steps.
        &[0xF0, 0x62, 0, 0, 0x42, 8, 10, 11, 0, 0xF7],
        &[0xF0, 0x62, 0, 0, 0x42, 8, 11, 9, 11, 0, 0xF7],
        &[0xF0, 0x62, 0, 0, 0x42, 8, 10, 9, 11, 1, 0xF7],
        &[0xF0, 0x62, 0, 0, 0x40, 8, 10, 9, 11, 0, 0xF7],
    ];
    for damaged in damaged {
        let mut rig = plain();
        rig.swap(TO_DEVICE, &CONFIGURE, damaged);
        let reported = turn_or_fail(&mut rig, TAU * 0.75).expect("it is set up again");
        assert!((reported - TAU * 0.75).abs() < half_step(), "{damaged:x?}: {reported}");
    }
}

#[test]
fn a_garbled_report_at_set_up_is_no_base() {
    let report = |position: [u8; 5]| [&[0xF0, 0x62, 6, 0][..], &position, &[0xF7]].concat();
    for garbled in [[64, 0, 0, 0, 0], [0, 0, 64, 0, 0], [0, 0, 0, 64, 0]] {
        let mut rig = plain();
        rig.swap(FROM_DEVICE, &report([0; 5]), &report(garbled));
        let reported = turn_or_fail(&mut rig, 1.0).expect("it is queried again");
        assert!(abs_diff_eq!(reported, 1.0, epsilon = half_step()), "{garbled:?}: {reported}");
    }
}

#[test]
fn a_garbled_target_is_bounded_and_lost() {
    // Twice as far, 16,384 half steps further, and backwards.
    let damaged: [&[u8]; 3] =
        [&[0, 0x20, 0, 0, 0], &[0x0A, 0x05, 1, 0, 0], &[0x0A, 0x05, 0, 0, 0x08]];
    for target in damaged {
        let mut rig = plain();
        rig.turn(0.0);
        rig.swap(TO_DEVICE, &to(650)[4..9], target);
        let failed = turn_or_fail(&mut rig, 650.0 * half_step()).expect_err("it is lost");
        assert!(matches!(failed, FirmataStepperError::PositionLost { .. }), "{failed}");
        let rotor = rig.device.rotor();
        assert!((-POSITION..=650 + POSITION).contains(&rotor), "{target:?}: {rotor}");
    }
}

#[test]
fn what_falls_silent_is_stopped() {
    let mut rig = plain();
    rig.turn(0.0);
    rig.swap(TO_DEVICE, &to(650)[4..9], &[0x0A, 0x05, 1, 0, 0]);
    rig.driver.turn_to(650.0 * half_step()).expect("it is accepted");
    rig.cable.borrow_mut().loses_every = Some(1);
    let failed = (0..2000).find_map(|_| rig.tick().err()).expect("it is reported");
    assert!(failed.to_string().contains("did not end"), "{failed}");
    stays(&mut rig);
    let failed = rig.tick().expect_err("it is still silent").to_string();
    assert!(failed.contains("fell silent") || failed.contains("no Firmata"), "{failed}");
    let rotor = rig.device.rotor();
    assert!(rotor < 650 + POSITION, "no answer is a reason to stop: {rotor}");
}

#[test]
fn the_end_of_the_program_is_a_stop() {
    let mut rig = plain();
    rig.turn(0.0);
    rig.driver.turn_to(3.0).expect("it is accepted");
    ticks(&mut rig, 0.3);
    let Rig { driver, mut device, world, .. } = rig;
    drop(driver);
    let mut serve = |seconds| {
        world.advance(seconds).expect("a step");
        // Its other end is closed.
        let _ = device.serve();
        device.rotor()
    };
    let stopped = serve(0.01);
    assert_eq!(serve(10.0), stopped);
}

#[test]
fn an_order_that_became_a_zero_is_a_lost_position() {
    // From −68 to 0, and from 0 to 650 by way of a query that became a zero.
    let mut rig = plain();
    rig.swap(TO_DEVICE, &to(0)[..9], &[0xF0, 0x62, 1, 0, 0, 0, 0, 0, 0]);
    let failed = turn_or_fail(&mut rig, 0.0).expect_err("the coils stand elsewhere");
    assert!(matches!(failed, FirmataStepperError::PositionLost { .. }), "{failed}");

    let mut rig = plain();
    rig.turn(0.0);
    rig.driver.turn_to(650.0 * half_step()).expect("it is accepted");
    rig.swap(TO_DEVICE, &[0xF0, 0x62, 6, 0, 0xF7], &[0xF0, 0x62, 1, 0, 0xF7]);
    let failed = rig.wait(60.0).expect_err("it stands at 0, where it was not sent");
    assert!(failed.to_string().contains("set to 0"), "{failed}");
    stays(&mut rig);
}

#[test]
fn a_lost_speed_is_sent_again_and_a_garbled_one_distrusted() {
    // 600 is 6 · 10²; the exponent is 2 + 11.
    let speed = [0xF0, 0x62, 9, 0, 6, 0, 0, 0x34, 0xF7];
    let mut rig = plain();
    rig.swap(TO_DEVICE, &speed, &[0xF0, 0x62, 9, 0xF7]);
    rig.driver.turn_to(1.0).expect("it is accepted");
    let reported = rig.wait(8.0).expect("it is urged");
    assert_abs_diff_eq!(reported, 1.0, epsilon = half_step());

    let mut rig = plain();
    rig.swap(TO_DEVICE, &speed, &[0xF0, 0x62, 9, 0, 6, 0, 0, 0x38, 0xF7]);
    let failed = turn_or_fail(&mut rig, 1.0).expect_err("no 28BYJ-48 is so fast");
    assert!(matches!(failed, FirmataStepperError::PositionLost { .. }), "{failed}");
}

#[test]
fn no_set_up_takes_up_memory() {
    let mut rig = plain();
    ticks(&mut rig, 0.01);
    rig.cable.borrow_mut().loses_every = Some(1);
    ticks(&mut rig, 30.0);
    rig.cable.borrow_mut().loses_every = None;
    ticks(&mut rig, 1.0);
    let reported = turn_or_fail(&mut rig, 1.0).expect("the firmware does not hang");
    assert_abs_diff_eq!(reported, 1.0, epsilon = half_step());
}

#[test]
fn a_set_up_keeps_the_phase_of_the_coils() {
    let mut rig = rig(FirmataConfig { trust_after_reset: true, ..FirmataConfig::default() });
    rig.turn(0.0);
    for phase in (0..8).chain(0..8) {
        rig.turn(f64::from(400 + phase) * half_step());
        rig.device.reset();
        let (reported, truth) = rig.turn(1.5);
        assert!((truth - reported).abs() < 0.01 * half_step(), "{phase}: {reported} is {truth}");
    }
}

#[test]
fn a_stopped_motor_has_lost_its_speed() {
    let homing = Homing::Switch { pin: 2, at_deg: 0.0 };
    let switch = EmulatedSwitch { pin: 2, opens_at_deg: 0.0, width_deg: 40.0 };
    let emulated = EmulatedStepperConfig {
        start_deg: 120.0,
        switch: Some(switch),
        ..EmulatedStepperConfig::default()
    };
    let mut rig = Rig::new(FirmataConfig { homing, ..ramped() }, emulated);
    let mut lowest = f64::INFINITY;
    let homed = (0..12_000).any(|_| {
        let stands = rig.tick().expect("nothing fails").is_some();
        lowest = lowest.min(rig.truth());
        stands
    });
    assert!(homed && rig.truth().abs() < 2.0 * half_step(), "{}", rig.truth());
    // 20 ms until the stop is there.
    assert!(lowest > -40.0 * half_step(), "it goes on by {} half steps", -lowest / half_step());
}

/// Findings of a stepper whose device is served meanwhile.
fn findings(rig: &mut Rig) -> Vec<String> {
    let Rig { world, driver, device, .. } = rig;
    let findings = driver.examine(&mut || {
        world.advance(0.01).expect("a step");
        device.serve().expect("its end holds");
    });
    findings.iter().map(ToString::to_string).collect()
}

#[test]
fn mistakes_with_the_stock_sketch_are_recognised() {
    let sketch = |accel_stepper, steppers_in_memory| {
        let emulated =
            EmulatedStepperConfig { accel_stepper, steppers_in_memory, ..Default::default() };
        findings(&mut Rig::new(FirmataConfig::default(), emulated)).join("\n")
    };
    let found = sketch(false, 12);
    assert!(found.contains("take the comment off ENABLE_ACCELSTEPPER"), "{found}");
    let found = sketch(true, 0);
    assert!(found.contains("a Nano has no room for more"), "{found}");

    let mut rig = plain();
    // At twice the rate each byte comes as others.
    rig.cable.borrow_mut().loses_every = Some(1);
    rig.cable.borrow_mut().noise = vec![0xE6, 0x9E, 0x06, 0x78];
    let found = findings(&mut rig).join("\n");
    assert!(found.contains("115200"), "{found}");
}

#[test]
fn a_clean_set_up_is_as_short_as_it_was() {
    let mut rig = plain();
    rig.wait(1.0).expect("it stands");
    let set_up = rig.cable.borrow().passed;
    let at = rig.world.clock().now();
    rig.driver.turn_to(1.0).expect("it is accepted");
    rig.wait(5.0).expect("it comes there");
    let first = rig.cable.borrow().passed;
    let came = rig.world.clock().now();
    println!("stands after {at:.2} s and {set_up:?} bytes, at 1 rad after {came:.2} s, {first:?}");
    // The greeting, its set-up and one report: Configure, speed, ramp, enable and a query were 40
    // bytes.
    assert!(at < 0.08 && set_up[TO_DEVICE] <= 40, "{at} s, {set_up:?} bytes");
}
