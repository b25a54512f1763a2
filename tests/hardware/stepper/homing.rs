use approx::assert_abs_diff_eq;
use foxhunt::{
    core::Rotator,
    hardware::{FirmataConfig, FirmataStepperError, Homing},
    sim::{EmulatedStepperConfig, EmulatedSwitch},
};

use super::rig::{Rig, half_step};

fn config() -> FirmataConfig {
    let homing = Homing::Switch { pin: 2, at_deg: 30.0 };
    FirmataConfig { homing, ..FirmataConfig::default() }
}

fn emulated(start_deg: f64) -> EmulatedStepperConfig {
    let switch = EmulatedSwitch { pin: 2, opens_at_deg: 30.0, width_deg: 8.0 };
    EmulatedStepperConfig { start_deg, switch: Some(switch), ..Default::default() }
}

#[test]
fn the_switch_is_found_from_everywhere() {
    // Above it, in the middle of it, just below it.
    for start_deg in [100.0, 27.0, 20.0, -120.0] {
        let mut rig = Rig::new(config(), emulated(start_deg));
        rig.driver.turn_to(1.0).expect("it is followed after homing");
        let reported = rig.wait(120.0).expect("it is homed");
        assert_abs_diff_eq!(reported, 1.0, epsilon = half_step() * 0.5 + 1e-9);
        // The edge lies between two steps, and whole turns of the truth do not matter.
        let error = foxhunt::core::angle::distance(rig.truth(), 1.0);
        assert!(error < 1.6 * half_step(), "from {start_deg}: {error}");
    }
}

#[test]
fn it_is_homed_again_after_a_reset_and_goes_on() {
    let mut rig = Rig::new(config(), emulated(0.0));
    rig.turn(2.0);
    rig.driver.turn_to(-1.0).expect("it is accepted");
    for _ in 0..30 {
        rig.tick().expect("it turns");
    }
    rig.device.reset();
    let reported = rig.wait(120.0).expect("nothing has to be declared");
    assert_abs_diff_eq!(reported, -1.0, epsilon = half_step());
    assert!(foxhunt::core::angle::distance(rig.truth(), -1.0) < 1.6 * half_step());
    rig.driver.find_home().expect("it has a switch");
    let reported = rig.wait(120.0).expect("it is found again");
    assert_abs_diff_eq!(reported, 30.0_f64.to_radians(), epsilon = half_step());
}

#[test]
fn a_switch_that_is_not_there_is_named() {
    let mut rig = Rig::new(config(), EmulatedStepperConfig::default());
    let reported = (0..6000).find_map(|_| rig.tick().err()).expect("it is reported");
    assert!(matches!(reported, FirmataStepperError::NoHome { .. }), "{reported}");
    assert!(reported.to_string().contains("pin 2 did not close within 1.1 turns"), "{reported}");
    assert!(rig.tick().is_err() && rig.driver.turn_to(0.0).is_err(), "each time");
    let mut without = Rig::new(FirmataConfig::default(), EmulatedStepperConfig::default());
    let refused = without.driver.find_home();
    assert!(matches!(refused, Err(FirmataStepperError::NoSwitch)), "{refused:?}");
}
