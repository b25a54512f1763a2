//! The stepper's driver against our own firmware in the AVR simulator.

use approx::assert_abs_diff_eq;
use std::{env, f64::consts::TAU, thread, time::Duration};

use foxhunt::{
    core::{Clock, Rotator},
    hardware::{Finding, FirmataConfig, FirmataStepper, Homing, Reconnecting, SystemClock},
    wire::Endpoint,
};

type Stepper = FirmataStepper<Reconnecting<SystemClock>, SystemClock>;

/// Half steps in a turn.
const TURN: f64 = 64.0 * 283_712.0 / 4455.0;

fn stepper(port: &str, config: FirmataConfig) -> Stepper {
    let endpoint: Endpoint = format!("serial:{port}:57600").parse().expect("it is a port");
    let clock = SystemClock::start();
    let stream = Reconnecting::open(endpoint, clock).expect("the simulator runs");
    FirmataStepper::new(config, stream, clock).expect("it is in order")
}

/// Turns there, and returns the reported boresight. The simulator may be slower than the clock on
/// the wall.
fn turn(stepper: &mut Stepper, angle: f64) -> f64 {
    stepper.turn_to(angle).expect("the order is accepted");
    let clock = SystemClock::start();
    while clock.now() < 300.0 {
        if let Some(reported) = stepper.poll().expect("the link holds") {
            return reported;
        }
        thread::sleep(Duration::from_millis(1));
    }
    panic!("it does not come to {angle} rad: {stepper:?}");
}

#[test]
#[ignore = "needs the AVR simulator: .ci/peers/firmware"]
fn no_half_step_is_lost_and_the_switch_is_found() {
    let port = env::var("FOXHUNT_FIRMWARE_PORT").expect("FOXHUNT_FIRMWARE_PORT names its port");
    let config = FirmataConfig {
        speed_half_steps_per_s: 1000.0,
        acceleration_half_steps_per_s2: 8000.0,
        answer_timeout_s: 60.0,
        ..FirmataConfig::default()
    };
    let mut motor = stepper(&port, config.clone());
    for position in (0..128).chain((0..128).rev()) {
        let angle = TAU * f64::from(position) / 128.0;
        let reported = turn(&mut motor, angle);
        assert_abs_diff_eq!(reported, angle, epsilon = TAU / TURN * 0.5 + 1e-9);
    }
    let findings = motor.examine(&mut || thread::sleep(Duration::from_millis(1)));
    assert!(findings.iter().all(Finding::is_good), "{findings:?}");
    assert!(findings[0].to_string().contains("foxhunt-stepper 1.1"), "{findings:?}");
    drop(motor);

    // The switch opens at −100 half steps of the rotor, which is 0 from now on.
    let homing = Homing::Switch { pin: 2, at_deg: 0.0 };
    let mut motor = stepper(&port, FirmataConfig { homing, ..config });
    let angle = TAU * 64.0 / TURN;
    let reported = turn(&mut motor, angle);
    assert_abs_diff_eq!(reported, angle, epsilon = 1e-9);
}
