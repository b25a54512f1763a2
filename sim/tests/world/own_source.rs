//! The parts of a user's own source: samples through his own antenna, true places and speeds.

use approx::assert_abs_diff_eq;
use std::f64::consts::{FRAC_PI_2, TAU};

use foxhunt_core::{BeaconId, PatternSource, Pose, Vehicle, Waypoint};
use foxhunt_sensors::{Antenna, AntennaConfig, BodyConfig, StepperConfig};
use foxhunt_sim::{
    BeaconCourse, ChannelConfig, KinematicConfig, QuadrotorConfig, SimError, VehicleConfig, World,
    WorldConfig,
};
use nalgebra::Vector3;

use crate::rig::{Rig, config, level, quiet, reflector};

/// A beam that is 10 dB above its back, 30° to either side.
#[derive(Debug)]
struct Beam;

impl Antenna for Beam {
    fn gain_dbi(&self, azimuth: f64, _elevation: f64) -> f64 {
        if azimuth.cos() > (FRAC_PI_2 / 3.0).cos() { 7.0 } else { -3.0 }
    }
}

/// The readings of a radio at these directions, and the readings of `receive` in the same world.
fn both(channel: ChannelConfig, boresights: &[f64]) -> [Vec<Option<u64>>; 2] {
    let config = config(channel);
    let antenna = config.channel.antenna.build().expect("in order");
    let mut rig = Rig::new(&config, 7);
    let by_radio = boresights.iter().map(|boresight| {
        rig.turn_to(*boresight);
        rig.request(0).map(f64::to_bits)
    });
    let by_radio = by_radio.collect();
    let world = World::new(&config, 7).expect("in order");
    let direct = boresights.iter().map(|boresight| {
        let reading = world.receive(0, BeaconId(0), &antenna, *boresight).expect("it exists");
        reading.map(f64::to_bits)
    });
    [by_radio, direct.collect()]
}

#[test]
fn the_channels_own_antenna_receives_what_the_radio_does_to_the_bit() {
    let boresights: Vec<f64> = (1..16).map(|i| f64::from(i) * TAU / 16.0).collect();
    for antenna in [AntennaConfig::ReferencePatch, AntennaConfig::Dipole] {
        let channel = ChannelConfig {
            antenna,
            loss_probability: 0.3,
            reflectors: vec![reflector(0.4)],
            whole_db: true,
            ..ChannelConfig::default()
        };
        let [by_radio, direct] = both(channel, &boresights);
        assert_eq!(by_radio, direct);
        assert!(direct.iter().any(Option::is_none) && direct.iter().any(Option::is_some));
    }
}

#[test]
fn an_own_antenna_keeps_the_level_and_has_its_own_pattern() {
    let world = World::new(&config(quiet()), 1).expect("in order");
    let law = foxhunt_sensors::LogDistance::pritzl2018_field();
    let expected = foxhunt_sensors::Propagation::rss_dbm(&law, 50.0);
    let bearing = 40.0_f64.atan2(30.0);
    let receive = |boresight| {
        let reading = world.receive(0, BeaconId(0), &Beam, boresight).expect("it exists");
        reading.expect("nothing is lost")
    };
    let turn: Vec<(f64, f64)> = (0..360_u16)
        .map(|degree| f64::from(degree).to_radians())
        .map(|boresight| (boresight, receive(bearing + boresight)))
        .collect();
    assert_abs_diff_eq!(level(&turn), expected, epsilon = 1e-9);
    assert_abs_diff_eq!(receive(bearing) - receive(bearing + 1.0), 10.0, epsilon = 1e-9);
}

/// Without `begin_pattern` a drone that stays has one offset for all its samples.
#[test]
fn a_pattern_lasts_until_a_new_one_is_begun() {
    let channel =
        ChannelConfig { sample_sigma_db: 0.0, bearing_sigma_deg: 0.0, ..ChannelConfig::default() };
    let world = World::new(&config(channel), 1).expect("in order");
    let receive = || world.receive(0, BeaconId(0), &Beam, 0.0).expect("it exists");
    let first = receive();
    assert_eq!([receive(), receive()], [first; 2]);
    world.begin_pattern(0).expect("it exists");
    assert_ne!(receive(), first);
}

#[test]
fn what_there_is_not_is_refused() {
    let world = World::new(&config(quiet()), 1).expect("in order");
    let receive = |drone, beacon, boresight| {
        world.receive(drone, BeaconId(beacon), &Beam, boresight).expect_err("there is none")
    };
    assert_eq!(receive(1, 0, 0.0), SimError::Drone { drone: 1, drones: 1 });
    assert_eq!(receive(0, 2, 0.0), SimError::Beacon { beacon: 2, beacons: 2 });
    assert!(matches!(receive(0, 0, f64::NAN), SimError::Angle { angle } if angle.is_nan()));
    assert!(world.begin_pattern(1).is_err() && world.velocity(1).is_err());
    assert_eq!(world.true_velocity(BeaconId(2)), None);
}

#[test]
fn beacons_and_drones_have_true_velocities() {
    let mut config = config(quiet());
    config.vehicle = VehicleConfig::default();
    config.beacons[1].course = Some(BeaconCourse::Circle { radius_m: 10.0, period_s: TAU * 10.0 });
    let world = World::new(&config, 1).expect("in order");
    let goal = Waypoint { position: Vector3::new(30.0, 40.0, 0.0) };
    world.vehicle(0).expect("it exists").go_to(&goal).expect("a place");
    world.advance(1.0).expect("a step");
    let velocity = world.velocity(0).expect("it exists");
    assert!((velocity - Vector3::new(1.2, 1.6, 0.0)).norm() < 1e-12, "{velocity}");
    assert_eq!(world.true_velocity(BeaconId(0)), Some(Vector3::zeros()));
    let moving = world.true_velocity(BeaconId(1)).expect("it exists");
    assert!((moving - Vector3::new(-0.1_f64.sin(), 0.1_f64.cos(), 0.0)).norm() < 1e-12, "{moving}");
}

/// The pose over a drone's link, and in the sweeps of its sources.
fn poses(vehicle: VehicleConfig) -> Vec<Pose> {
    let config = WorldConfig { vehicle, ..config(quiet()) };
    let world = World::new(&config, 1).expect("in order");
    let mut vehicle = world.vehicle(0).expect("there is one");
    let beacon = [BeaconId(0)];
    vehicle.go_to(&Waypoint { position: Vector3::new(300.0, 0.0, 0.0) }).expect("a place");
    let mut stepper = world.stepper(0, StepperConfig::pritzl2018()).expect("it exists");
    let mut body = world.body(0, BodyConfig::isaacs2014()).expect("it exists");
    // Until it is as fast as it gets.
    world.advance(10.0).expect("a step");
    stepper.begin(&beacon).expect("it works");
    let mut poses = Vec::new();
    for _ in 0..2000 {
        world.advance(0.01).expect("a step");
        if let Some(sweep) = stepper.poll().expect("it works") {
            poses.push(sweep.receiver);
            break;
        }
    }
    body.begin(&beacon).expect("it works");
    for _ in 0..2000 {
        world.advance(0.01).expect("a step");
        if let Some(sweep) = body.poll().expect("it works") {
            poses.push(sweep.receiver);
            break;
        }
    }
    poses.push(vehicle.pose().expect("there is a link"));
    assert_eq!(poses.len(), 3);
    poses
}

#[test]
fn a_vehicle_reports_its_velocity_where_it_shall() {
    let kinematic = KinematicConfig { reports_velocity: true, ..KinematicConfig::default() };
    let quadrotor = QuadrotorConfig { reports_velocity: true, ..QuadrotorConfig::default() };
    for vehicle in [VehicleConfig::Kinematic(kinematic), VehicleConfig::Quadrotor(quadrotor)] {
        for pose in poses(vehicle) {
            let velocity = pose.velocity.expect("it is reported");
            assert!((velocity - Vector3::new(2.0, 0.0, 0.0)).norm() < 0.3, "{velocity}");
        }
        let text = serde_json::to_string(&vehicle).expect("plain data");
        assert!(text.contains("\"reports_velocity\":true"), "{text}");
        assert_eq!(serde_json::from_str::<VehicleConfig>(&text).expect("as written"), vehicle);
    }
    let silent = VehicleConfig::default();
    assert!(poses(silent).iter().all(|pose| pose.velocity.is_none()));
    assert!(!serde_json::to_string(&silent).expect("plain data").contains("velocity"));
}
