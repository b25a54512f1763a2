use approx::assert_abs_diff_eq;
use foxhunt::{
    core::Rotator,
    hardware::{FirmataConfig, FirmataStepperError},
    sim::EmulatedStepperConfig,
};

use super::rig::{Rig, half_step};

fn trusting() -> FirmataConfig {
    FirmataConfig { trust_after_reset: true, ..FirmataConfig::default() }
}

#[test]
fn a_reset_is_reported_until_the_antenna_is_declared() {
    let mut rig = Rig::new(FirmataConfig::default(), EmulatedStepperConfig::default());
    rig.turn(1.0);
    rig.device.reset();
    let lost = (0..100).find_map(|_| rig.tick().err()).expect("it is reported");
    assert!(matches!(lost, FirmataStepperError::PositionLost { .. }), "{lost}");
    assert!(lost.to_string().contains("the Arduino was reset"), "{lost}");
    for _ in 0..100 {
        assert!(rig.tick().is_err(), "each time");
        assert!(rig.driver.turn_to(0.0).is_err(), "and no order is followed");
    }
    // As if it had been turned to the nose by hand: it is off by where it was.
    rig.driver.zero().expect("it stands");
    rig.wait(5.0).expect("it is known again");
    let (reported, truth) = rig.turn(0.5);
    assert_abs_diff_eq!(reported, 0.5, epsilon = half_step());
    assert_abs_diff_eq!(truth, 1.5, epsilon = 2.0 * half_step());
}

#[test]
fn a_reset_of_a_still_antenna_may_be_trusted() {
    let mut rig = Rig::new(trusting(), EmulatedStepperConfig::default());
    for angle in [1.0, 2.0, 0.5] {
        rig.turn(angle);
        rig.device.reset();
        let reported = rig.wait(5.0).expect("it is trusted");
        assert_abs_diff_eq!(reported, angle, epsilon = half_step());
        let (reported, truth) = rig.turn(angle + 0.25);
        assert_abs_diff_eq!(reported - angle, 0.25, epsilon = half_step());
        assert_abs_diff_eq!(truth, reported, epsilon = 1e-9);
    }
    // In the middle of a move nothing is left to trust.
    rig.driver.turn_to(-2.0).expect("it is accepted");
    for _ in 0..20 {
        rig.tick().expect("it turns");
    }
    rig.device.reset();
    let lost = (0..2000).find_map(|_| rig.tick().err()).expect("it is reported");
    assert!(matches!(lost, FirmataStepperError::PositionLost { .. }), "{lost}");
}

#[test]
fn a_pulled_cable_is_reported_each_time_and_survived() {
    let mut rig = Rig::new(trusting(), EmulatedStepperConfig::default());
    rig.turn(1.0);
    rig.cable.borrow_mut().pulled = true;
    for _ in 0..100 {
        assert!(matches!(rig.tick(), Err(FirmataStepperError::Link(_))), "each time");
        assert!(rig.driver.turn_to(2.0).is_err());
    }
    // Its power comes through the cable, and the port is another one.
    rig.device.reset();
    *rig.cable.borrow_mut() = super::rig::Cable { connections: 2, ..Default::default() };
    let reported = rig.wait(5.0).expect("it is set up again");
    assert_abs_diff_eq!(reported, 1.0, epsilon = half_step());
    let (reported, truth) = rig.turn(2.0);
    assert_abs_diff_eq!(truth, 2.0, epsilon = half_step());
    assert_abs_diff_eq!(truth, reported, epsilon = 1e-9);
}

#[test]
fn a_link_that_fails_for_a_moment_costs_nothing() {
    let mut rig = Rig::new(FirmataConfig::default(), EmulatedStepperConfig::default());
    rig.turn(0.0);
    for angle in [2.0, 1.0, 3.0] {
        rig.driver.turn_to(angle).expect("it is accepted");
        for _ in 0..10 {
            rig.tick().expect("it turns");
        }
        rig.cable.borrow_mut().pulled = true;
        for _ in 0..10 {
            assert!(rig.tick().is_err());
        }
        rig.cable.borrow_mut().pulled = false;
        let reported = rig.wait(60.0).expect("it goes on");
        assert_abs_diff_eq!(reported, angle, epsilon = half_step());
        assert_abs_diff_eq!(rig.truth(), reported, epsilon = 1e-9);
    }
    // It was reset meanwhile, and the message of that lost: no answer is one, too.
    rig.cable.borrow_mut().pulled = true;
    assert!(rig.tick().is_err());
    rig.device.reset();
    assert!(rig.tick().is_err());
    rig.cable.borrow_mut().pulled = false;
    let lost = (0..2000).find_map(|_| rig.tick().err()).expect("it is found out");
    assert!(matches!(lost, FirmataStepperError::PositionLost { .. }), "{lost}");
}

#[test]
fn garbage_and_lost_bytes_are_made_good() {
    let mut rig = Rig::new(FirmataConfig::default(), EmulatedStepperConfig::default());
    // A generator of bytes, the same in every run.
    let mut state = 1_u32;
    let mut byte = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state.to_be_bytes()[0]
    };
    // The firmware's name is longer than what comes through whole below.
    rig.turn(0.0);
    for position in 0..64_i32 {
        let noise: Vec<u8> = (0..50).map(|_| byte()).collect();
        rig.cable.borrow_mut().noise = noise;
        rig.cable.borrow_mut().loses_every = (position % 2 == 0).then_some(17);
        let angle = f64::from(position % 16) * 0.1;
        let (reported, truth) = rig.turn(angle);
        assert_abs_diff_eq!(reported, angle, epsilon = half_step());
        assert_abs_diff_eq!(truth, reported, epsilon = 1e-9);
    }
}

#[test]
fn a_lost_order_is_repeated() {
    let mut rig = Rig::new(FirmataConfig::default(), EmulatedStepperConfig::default());
    rig.turn(0.0);
    rig.cable.borrow_mut().swallows = 1;
    rig.driver.turn_to(0.5).expect("it is accepted");
    // 325 half steps are 0.54 s; queried twice after that, and ordered again.
    let reported = rig.wait(3.0).expect("it comes there in time");
    assert_abs_diff_eq!(reported, 0.5, epsilon = half_step());
    assert_abs_diff_eq!(rig.truth(), reported, epsilon = 1e-9);
}

#[test]
fn silence_and_a_foreign_firmware_are_reported() {
    let config = FirmataConfig::default();
    let mut rig = Rig::new(config.clone(), EmulatedStepperConfig::default());
    rig.cable.borrow_mut().loses_every = Some(1);
    let reported = (0..1000).find_map(|_| rig.tick().err()).expect("it is reported");
    assert!(
        matches!(reported, FirmataStepperError::NoAnswer { seconds, .. } if seconds < 6.0),
        "{reported}"
    );
    rig.cable.borrow_mut().loses_every = None;
    let received = (0..100).find_map(|_| rig.tick().ok().flatten());
    assert!(received.is_some(), "it was queried again");

    let emulated = EmulatedStepperConfig { accel_stepper: false, ..Default::default() };
    let mut rig = Rig::new(config, emulated);
    let reported = (0..1000).find_map(|_| rig.tick().err()).expect("it is reported");
    assert!(matches!(reported, FirmataStepperError::NoStepper { .. }), "{reported}");
    assert!(reported.to_string().contains("EmulatedFirmata 3.4"), "{reported}");
}

#[test]
fn a_move_that_never_ends_times_out_with_its_steps() {
    let mut rig = Rig::new(FirmataConfig::default(), EmulatedStepperConfig::default());
    rig.turn(0.0);
    rig.driver.turn_to(1.0).expect("it is accepted");
    rig.cable.borrow_mut().loses_every = Some(1);
    let reported = (0..2000).find_map(|_| rig.tick().err()).expect("it is reported");
    let FirmataStepperError::MoveTimeout { steps: 649, seconds } = reported else {
        panic!("{reported}");
    };
    // Twice what it takes at 600 a second, and the 5 s of an answer.
    assert_abs_diff_eq!(seconds - 2.0 * 649.0 / 600.0, 5.0, epsilon = 0.02);
    rig.cable.borrow_mut().loses_every = None;
    // The order is forgotten with the error: nothing turns that nobody waits for.
    let reported = rig.wait(60.0).expect("it is known where it stopped");
    assert_abs_diff_eq!(rig.truth(), reported, epsilon = 1e-9);
    let (reported, truth) = rig.turn(1.0);
    assert_abs_diff_eq!(reported, 1.0, epsilon = half_step());
    assert_abs_diff_eq!(truth, reported, epsilon = 1e-9);
}

#[test]
fn what_is_found_is_reported_with_its_remedy() {
    let mut rig = Rig::new(FirmataConfig::default(), EmulatedStepperConfig::default());
    let findings = {
        let Rig { world, driver, device, .. } = &mut rig;
        let mut pause = || {
            world.advance(0.01).expect("a step");
            foxhunt::sim::Emulator::serve(device).expect("it holds");
        };
        driver.examine(&mut pause)
    };
    let text: Vec<String> = findings.iter().map(ToString::to_string).collect();
    assert!(findings.iter().all(foxhunt::hardware::Finding::is_good), "{text:?}");
    assert!(text[0].contains("EmulatedFirmata 3.4"), "{text:?}");
    assert!(text[1].contains("went to 64 and back to 0"), "{text:?}");
    assert!(text[2].contains("position: 0.0°"), "{text:?}");
    rig.cable.borrow_mut().pulled = true;
    let findings = {
        let Rig { world, driver, .. } = &mut rig;
        driver.examine(&mut || world.advance(0.01).expect("a step"))
    };
    let [_, link] = &findings[..] else { panic!("{findings:?}") };
    assert!(link.to_string().contains("plug the Arduino in"), "{link}");
}
