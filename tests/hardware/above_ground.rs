//! Heights above the ground that autopilots report of themselves.

use approx::abs_diff_eq;
use foxhunt::{
    hardware::{Finding, MavlinkConfig},
    sim::{AutopilotConfig, AutopilotFaults, Emulator, Interval, KinematicConfig, ReliefConfig},
    wire::mavlink::Autopilot,
};
use foxhunt_core::{HeightSource, Vehicle, Waypoint};
use foxhunt_sensors::Hill;
use nalgebra::Vector3;

use super::mavlink::{Field, TICK};

const BOTH: [Autopilot; 2] = [Autopilot::ArduPilot, Autopilot::Px4];

/// A vehicle with a rangefinder of 0.2 to 40 m.
fn ranged(autopilot: Autopilot) -> AutopilotConfig {
    AutopilotConfig { autopilot, rangefinder_m: Some([0.2, 40.0]), ..AutopilotConfig::default() }
}

fn above(field: &Field) -> f64 {
    field.world.pose(0).expect("a drone").position.z
}

fn examine(Field { world, emulated, driver }: &mut Field) -> Vec<Finding> {
    driver.examine(&mut || {
        world.advance(TICK).expect("time passes");
        emulated.serve().expect("a cable");
    })
}

/// Error and source of the height that it reports, if it does.
fn reported(field: &mut Field, seconds: f64) -> Option<(f64, HeightSource)> {
    let height = field.run(seconds).above_ground?.height;
    Some((height.metres - above(field), height.source))
}

#[test]
fn a_rangefinder_counts_within_its_range_and_terrain_beyond() {
    for autopilot in BOTH {
        let config = AutopilotConfig { terrain_data: true, ..ranged(autopilot) };
        let mut field = Field::new(config, MavlinkConfig::default());
        let findings = examine(&mut field);
        let finding = findings.iter().find(|finding| finding.subject == "height above ground");
        let text = &finding.expect("it has devices for that").text;
        assert_eq!(text, "rangefinder out of its range, terrain 0.0 m (autopilot's)");
        let is_near = |of: Option<(f64, HeightSource)>, source| {
            of.is_some_and(|(error, by)| by == source && error.abs() < 0.02)
        };
        let on_ground = reported(&mut field, 2.0);
        assert!(is_near(on_ground, HeightSource::Terrain), "{autopilot}: {on_ground:?}");
        field.fly(8.0);
        field.go(20.0, 15.0, 12.0);
        let low = reported(&mut field, 3.0);
        assert!(is_near(low, HeightSource::Rangefinder), "{autopilot}: {low:?}");
        field.go(20.0, 15.0, 45.0);
        let high = reported(&mut field, 3.0);
        assert!(is_near(high, HeightSource::Terrain), "{autopilot}: {high:?}");
    }
}

#[test]
fn a_plain_vehicle_reports_none() {
    for autopilot in BOTH {
        let mut field = Field::of(autopilot);
        let findings = examine(&mut field);
        assert!(findings.iter().all(|finding| finding.subject != "height above ground"));
        field.fly(8.0);
        assert_eq!(reported(&mut field, 20.0), None, "{autopilot}");
    }
}

#[test]
fn a_height_is_forgotten_when_it_is_old() {
    let faults = AutopilotFaults {
        silent: vec![Interval { from_s: 30.0, to_s: None }],
        ..AutopilotFaults::default()
    };
    let mut field = Field::new(
        AutopilotConfig { faults, ..ranged(Autopilot::ArduPilot) },
        MavlinkConfig::default(),
    );
    field.fly(8.0);
    field.run(29.0 - field.world.time());
    assert!(reported(&mut field, 3.0).is_some(), "two seconds of silence");
    assert_eq!(reported(&mut field, 4.0), None);
}

/// A hill of 6 m, 25 m to the East of where the drone starts.
#[test]
fn a_flight_over_a_hill_comes_nearer_to_the_ground() {
    for autopilot in BOTH {
        let hill = Hill { east_m: 28.0, north_m: -2.0, height_m: 6.0, radius_m: 8.0 };
        let mut field = Field::over(
            Some(ReliefConfig::of_hills(vec![hill])),
            KinematicConfig::default(),
            ranged(autopilot),
            MavlinkConfig::default(),
        );
        assert!(abs_diff_eq!(above(&field), 0.0, epsilon = 1e-9), "it begins on the ground");
        field.fly(10.0);
        let goal = Vector3::new(28.0, -2.0, 10.0);
        field.driver.go_to(&Waypoint { position: goal }).expect("accepted");
        field.run(30.0);
        // Its autopilot counts from where it stood.
        let up = field.driver.pose().expect("a pose").position.z;
        assert!(abs_diff_eq!(up, 10.0, epsilon = 0.1), "{autopilot}: {up}");
        let true_height = above(&field);
        assert!(abs_diff_eq!(true_height, 4.0, epsilon = 0.1), "{autopilot}: {true_height}");
        let (error, _) = reported(&mut field, 2.0).expect("within the range");
        assert!(abs_diff_eq!(error, 0.0, epsilon = 0.02), "{autopilot}: {error}");
        // It lands on the hill.
        field.driver.land().expect("accepted");
        field.until("down", 60.0, |state, _| !state.armed);
        assert!(abs_diff_eq!(above(&field), 0.0, epsilon = 0.1), "{autopilot}: {}", above(&field));
        let up = field.driver.pose().expect("a pose").position.z;
        assert!(abs_diff_eq!(up, 6.0, epsilon = 0.2), "{autopilot}: {up}");
    }
}
