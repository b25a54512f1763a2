//! Pictures by an autopilot's own camera.

use foxhunt::{
    hardware::{Aircraft, MavlinkConfig, MavlinkError},
    sim::AutopilotConfig,
    wire::mavlink::Autopilot,
};

use super::mavlink::Field;

const BOTH: [Autopilot; 2] = [Autopilot::ArduPilot, Autopilot::Px4];

/// A vehicle and its driver, with a camera or without.
fn with_camera(autopilot: Autopilot, on_board: bool, configured: bool) -> Field {
    let emulated = AutopilotConfig { autopilot, camera: on_board, ..AutopilotConfig::default() };
    Field::new(emulated, MavlinkConfig { camera: configured, ..MavlinkConfig::default() })
}

#[test]
fn one_picture_is_taken_for_each_order() {
    for autopilot in BOTH {
        let mut field = with_camera(autopilot, true, true);
        field.run(5.0);
        let refused = field.driver.photograph();
        assert!(matches!(refused, Err(MavlinkError::NotCommanded { .. })), "{refused:?}");
        field.fly(8.0);
        for pictures in 1..=2 {
            field.driver.photograph().expect("ordered");
            field.run(6.0);
            assert_eq!(field.emulated.pictures(), pictures, "{autopilot}");
        }
        assert!(field.driver.picture_failure().is_none());
        // It is taken on the way home, too.
        field.driver.photograph().expect("ordered");
        field.driver.return_to_launch().expect("accepted");
        field.run(6.0);
        assert_eq!(field.emulated.pictures(), 3, "{autopilot}");
    }
}

#[test]
fn a_camera_that_is_not_there_is_reported_once() {
    for autopilot in BOTH {
        let mut field = with_camera(autopilot, false, true);
        field.fly(8.0);
        field.driver.photograph().expect("ordered");
        let state = field.run(20.0);
        let failure = field.driver.picture_failure().expect("nobody took it").to_string();
        let expected = "no picture was taken: the autopilot does not know this order";
        assert_eq!(failure, expected, "{autopilot}");
        assert!(field.driver.picture_failure().is_none());
        assert!(state.commanded && state.hindrance.is_empty(), "it flies on: {state:?}");
    }
}

#[test]
fn a_plain_vehicle_is_ordered_none() {
    let mut field = with_camera(Autopilot::ArduPilot, true, false);
    field.fly(8.0);
    field.driver.photograph().expect("nothing to do");
    field.run(6.0);
    assert_eq!((field.emulated.pictures(), field.driver.picture_failure().is_none()), (0, true));
}
