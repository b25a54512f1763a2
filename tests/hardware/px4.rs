//! Differences of PX4, and comparisons on every firmware: heights, gaps, refusals, doubts.

use approx::abs_diff_eq;
use std::collections::BTreeMap;

use foxhunt::{
    hardware::{Aircraft, FlightLimits, MavlinkConfig, MavlinkError},
    sim::{AutopilotConfig, AutopilotFaults, Emulator, GpsStep, Interval},
    wire::mavlink::Autopilot,
};
use foxhunt_core::{Vehicle, Waypoint};
use nalgebra::Vector3;

use super::mavlink::{Field, TICK};

const BOTH: [Autopilot; 2] = [Autopilot::ArduPilot, Autopilot::Px4];

fn field(autopilot: Autopilot, faults: AutopilotFaults) -> Field {
    let config = AutopilotConfig { autopilot, faults, ..AutopilotConfig::default() };
    Field::new(config, MavlinkConfig::default())
}

fn px4(faults: AutopilotFaults) -> Field {
    field(Autopilot::Px4, faults)
}

fn up(field: &Field) -> f64 {
    field.world.pose(0).expect("a drone").position.z
}

fn parameters(set_up: &[(&str, f64)]) -> BTreeMap<String, f64> {
    set_up.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect()
}

#[test]
fn every_version_of_px4_takes_off() {
    for px4_minor in [15, 16, 18] {
        let autopilot = Autopilot::Px4;
        let config = AutopilotConfig { autopilot, px4_minor, ..AutopilotConfig::default() };
        let mut field = Field::new(config, MavlinkConfig::default());
        field.fly(5.0);
        assert!(abs_diff_eq!(up(&field), 5.0, epsilon = 0.6), "1.{px4_minor}: {} m up", up(&field));
    }
}

/// The zero of the estimator is 2.5 m above or below home, and its altitude drifts by up to 3.6 m
/// while it flies.
#[test]
fn heights_of_goals_hang_on_no_reference() {
    for reference_m in [-2.5, 0.0, 2.5] {
        for reference_drift_mps in [-0.03, 0.0, 0.03] {
            let faults = AutopilotFaults { reference_m, reference_drift_mps, ..Default::default() };
            let mut field = px4(faults);
            field.fly(4.0);
            for (east, goal) in [(5.0, 4.0), (12.0, 3.0), (0.0, 8.0), (6.0, 4.0)] {
                let position = Vector3::new(east, 2.0, goal);
                field.driver.go_to(&Waypoint { position }).expect("accepted");
                let state = field.run(25.0);
                let off = up(&field) - goal;
                assert!(state.commanded && state.hindrance.is_empty(), "{state:?}");
                assert!(
                    abs_diff_eq!(off, 0.0, epsilon = 0.3),
                    "reference {reference_m} m, drift {reference_drift_mps} m/s: {off:.2} m off"
                );
            }
        }
    }
}

/// An autopilot that makes another height of a goal is called home, and the goal ends in words.
#[test]
fn a_height_that_is_misread_ends_the_goal() {
    for autopilot in BOTH {
        for (misread_up_m, words) in [(3.0, "3.0 m above the one"), (-0.6, "0.6 m below the one")] {
            let mut field =
                field(autopilot, AutopilotFaults { misread_up_m, ..Default::default() });
            field.fly(6.0);
            field.driver.go_to(&Waypoint { position: Vector3::new(4.0, 0.0, 6.0) }).expect("sent");
            let begun = field.world.time();
            field.until("noticed", 4.0, |state, _| !state.commanded);
            assert!(field.world.time() - begun < 3.0, "{autopilot}: too late");
            let state = field.run(1.0);
            assert!(state.hindrance.contains(words), "{autopilot}: {state:?}");
            field.until("home", 120.0, |state, _| !state.armed);
        }
    }
}

/// One that takes a goal for a place below the ground climbs again by its own way home before it is
/// there.
#[test]
fn who_sinks_below_the_limits_climbs_without_goals() {
    for autopilot in BOTH {
        let mut field =
            field(autopilot, AutopilotFaults { misread_up_m: -9.0, ..Default::default() });
        field.fly(2.6);
        let position = Vector3::new(3.0, -2.0, 2.6);
        let _ = field.driver.go_to(&Waypoint { position });
        let mut lowest = f64::INFINITY;
        let end = field.world.time() + 15.0;
        while field.world.time() < end {
            field.tick();
            lowest = lowest.min(up(&field));
        }
        let state = field.run(0.1);
        assert!(lowest > 0.2 && up(&field) > 5.0, "{autopilot}: {lowest} m, {state:?}");
        assert!(!state.commanded && state.hindrance.contains("m up"), "{state:?}");
    }
}

/// The link is silent in both directions; PX4 waits for set-points for as long as foxhunt waits for
/// the link, as the checklist has it.
#[test]
fn gaps_up_to_the_limit_change_nothing() {
    for autopilot in BOTH {
        for gap_s in [1.0, 2.0, 3.0] {
            // At every phase of the heartbeats.
            for phase in [0.0, 0.3, 0.6, 0.9] {
                let from_s = 30.0 + phase;
                let silent = vec![Interval { from_s, to_s: Some(from_s + gap_s) }];
                let faults = AutopilotFaults {
                    silent,
                    parameters: match autopilot {
                        Autopilot::Px4 => parameters(&[("COM_OF_LOSS_T", 3.5)]),
                        Autopilot::ArduPilot => BTreeMap::new(),
                    },
                    ..Default::default()
                };
                let mut field = field(autopilot, faults);
                field.fly(5.0);
                while field.world.time() < 40.0 {
                    let state = field.tick();
                    assert!(
                        state.commanded,
                        "{autopilot}, {gap_s} s from {from_s} s on, at {:.1} s: {state:?}",
                        field.world.time()
                    );
                }
                field.go(5.0, 5.0, 6.0);
            }
        }
    }
}

/// A gap of 10 s is a lost link: PX4 does what COM_OBL_RC_ACT has it do, ArduPilot what
/// FS_GCS_ENABLE.
#[test]
fn a_long_gap_ends_as_it_is_set_up() {
    for (autopilot, set_up, mode) in [
        (Autopilot::Px4, vec![("COM_OBL_RC_ACT", 0.0)], "POSITION"),
        (Autopilot::Px4, vec![("COM_OBL_RC_ACT", 3.0)], "RETURN"),
        (Autopilot::Px4, vec![("COM_OBL_RC_ACT", 4.0)], "LAND"),
        (Autopilot::Px4, vec![("COM_OBL_RC_ACT", 5.0)], "HOLD"),
        (Autopilot::ArduPilot, vec![], "RTL"),
    ] {
        let silent = vec![Interval { from_s: 30.0, to_s: Some(40.0) }];
        let parameters = parameters(&set_up);
        let mut field =
            field(autopilot, AutopilotFaults { silent, parameters, ..Default::default() });
        field.fly(12.0);
        let state = field.run(41.5 - field.world.time());
        assert_eq!((state.mode.as_str(), state.commanded), (mode, false), "{set_up:?} {state:?}");
    }
}

#[test]
fn refusals_are_given_in_words_before_anything_is_armed() {
    for autopilot in BOTH {
        let preflight = "Compass 0 uncalibrated".to_owned();
        let mut field = field(autopilot, AutopilotFaults { preflight, ..Default::default() });
        field.run(5.0);
        let _ = field.driver.take_off(5.0);
        let mut armed = false;
        let end = field.world.time() + 30.0;
        while field.world.time() < end {
            armed |= field.tick().armed;
        }
        let state = field.run(0.1);
        assert!(!armed && !state.hindrance.is_empty(), "{autopilot}: {state:?}");
        let texts: Vec<String> = field.driver.texts().map(str::to_owned).collect();
        assert!(!texts.iter().any(|text| text == "t"), "{texts:?}");
    }
}

/// The GPS is 55 m aside for 25 s: the estimator takes the other place, and the drone flies there.
#[test]
fn a_place_that_jumps_is_not_believed() {
    for autopilot in BOTH {
        let step = GpsStep { from_s: 40.0, to_s: 65.0, aside_m: [55.0, 0.0] };
        let mut field =
            field(autopilot, AutopilotFaults { gps_steps: vec![step], ..Default::default() });
        field.fly(5.0);
        let believed = field.driver.pose().expect("a pose").position;
        let mut words = Vec::new();
        let mut commanded = f64::NEG_INFINITY;
        while field.world.time() < 130.0 {
            let state = field.tick();
            let false_place = field.driver.pose().is_ok_and(|pose| {
                (pose.position - field.world.pose(0).expect("a drone").position).norm() > 5.0
            });
            assert!(!false_place, "{autopilot} at {:.1} s: {state:?}", field.world.time());
            if state.commanded {
                commanded = field.world.time();
            } else if !words.contains(&state.hindrance) {
                words.push(state.hindrance);
            }
        }
        let jumped =
            "its place jumped by 55 m, which no aircraft flies; what it receives is not used";
        assert!(words.iter().any(|text| text == jumped), "{words:?}");
        assert!(commanded > 125.0, "{autopilot}: it takes part again; {words:?}");
        let after = field.driver.pose().expect("a pose").position;
        assert!((after - believed).norm() < 1.0, "it is held at its goal: {after}");
    }
}

/// Goals beyond the autopilot's own fence are refused before they are sent.
#[test]
fn the_own_fence_is_read_and_kept() {
    for (autopilot, set_up) in [
        (Autopilot::ArduPilot, vec![("FENCE_ENABLE", 1.0), ("FENCE_RADIUS", 12.0)]),
        (Autopilot::Px4, vec![("GF_ACTION", 3.0), ("GF_MAX_HOR_DIST", 12.0)]),
    ] {
        let parameters = parameters(&set_up);
        let mut field = field(autopilot, AutopilotFaults { parameters, ..Default::default() });
        field.fly(5.0);
        let to = |east| Waypoint { position: Vector3::new(east, -2.0, 5.0) };
        field.driver.go_to(&to(12.5)).expect("9.5 m away");
        let error = field.driver.go_to(&to(14.0)).expect_err("11 m away");
        assert!(matches!(error, MavlinkError::OwnFence { .. }), "{error}");
        assert!(error.to_string().contains("up to 10.0 m"), "{error}");
        let state = field.run(8.0);
        assert!(state.commanded && state.hindrance.is_empty(), "{state:?}");
    }
}

/// A goal that the autopilot leaves out without an answer is said to be so.
#[test]
fn a_goal_that_is_left_out_is_said() {
    // A fence of which nothing is known: its parameters are answered to nobody else.
    let parameters = parameters(&[
        ("FENCE_ENABLE", 1.0),
        ("FENCE_TYPE", 2.0),
        ("FENCE_RADIUS", 12.0),
        ("FENCE_MARGIN", -20.0),
    ]);
    let mut field =
        field(Autopilot::ArduPilot, AutopilotFaults { parameters, ..Default::default() });
    field.fly(5.0);
    field.driver.go_to(&Waypoint { position: Vector3::new(25.0, -2.0, 5.0) }).expect("sent");
    let state = field.run(3.0);
    assert!(state.commanded && state.hindrance.contains("did not take its goal"), "{state:?}");
}

#[test]
fn what_the_checklist_reads_of_px4() {
    let cruise_speed_mps = Some(2.0);
    let limits = FlightLimits { max_up_m: 12.0, ..FlightLimits::default() };
    let look = |autopilot, set_up: &[(&str, f64)]| {
        let parameters = parameters(set_up);
        let faults = AutopilotFaults { parameters, ..Default::default() };
        let emulated = AutopilotConfig { autopilot, faults, ..AutopilotConfig::default() };
        let limits = limits.clone();
        let driver = MavlinkConfig { cruise_speed_mps, limits, ..MavlinkConfig::default() };
        let mut field = Field::new(emulated, driver);
        let Field { world, emulated, driver } = &mut field;
        // From the first moment on: a position is waited for.
        let findings = driver.examine(&mut || {
            world.advance(TICK).expect("time passes");
            emulated.serve().expect("a cable");
        });
        let lines: Vec<String> = findings.iter().map(ToString::to_string).collect();
        lines
    };
    let has = |lines: &[String], wanted: &str| {
        assert!(lines.iter().any(|line| line.starts_with(wanted)), "no {wanted:?} in {lines:#?}");
    };
    let usual = look(Autopilot::Px4, &[("GF_ACTION", 2.0)]);
    for wanted in [
        "position: 3D, 14 satellites, good to 0.50 m",
        "failsafe: fence: GF_ACTION is 2, but all its distances are 0: there is none (set",
        "failsafe: set-points: 1 s after the last one, as when foxhunt dies: POSITION, which is",
        "speed: up to 12 m/s (MPC_XY_VEL_MAX); cruise_speed_mps is 2 (set",
        "way home: 15.0 m up; limits.max_up_m is 12 (set RTL_RETURN_ALT to 12)",
    ] {
        has(&usual, wanted);
    }
    let set_up = look(
        Autopilot::Px4,
        &[
            ("GF_ACTION", 3.0),
            ("GF_MAX_HOR_DIST", 80.0),
            ("COM_OBL_RC_ACT", 3.0),
            ("COM_OF_LOSS_T", 3.5),
            ("MPC_XY_VEL_MAX", 2.0),
            ("RTL_RETURN_ALT", 11.0),
            ("COM_LOW_BAT_ACT", 3.0),
        ],
    );
    assert!(
        set_up.iter().all(|line| !line.ends_with(')') || line.contains("COM_OBL")),
        "{set_up:#?}"
    );
    has(&set_up, "failsafe: fence: GF_ACTION is 3; goals are planned within 78 m");
    let short = look(Autopilot::Px4, &[("COM_OBL_RC_ACT", 3.0)]);
    has(&short, "failsafe: set-points: 1 s after the last one, as when foxhunt dies: it returns");
    assert!(short.iter().any(|line| line.contains("set COM_OF_LOSS_T to 3.5")), "{short:#?}");
    let other = look(Autopilot::ArduPilot, &[("SYSID_MYGCS", 250.0), ("FENCE_ENABLE", 1.0)]);
    let words = "failsafe: ground station: SYSID_MYGCS is 250, and foxhunt is 255: if foxhunt dies";
    has(&other, words);
    has(&other, "failsafe: fence: FENCE_ENABLE is 1; goals are planned within 298 m, up to 98 m");
}
