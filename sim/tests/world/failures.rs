//! Drones that stand still, cannot be reached, receive nothing or answer late; beacons that scatter
//! or come later.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use foxhunt_core::{BeaconId, PatternSource, Spinner, Vehicle, Waypoint, laws::pattern_source};
use foxhunt_sensors::{OmnidirectionalConfig, StepperConfig};
use foxhunt_sim::{
    ChannelConfig, DroneConfig, Interval, KinematicConfig, OtherConfig, QuadrotorConfig, SimError,
    VehicleConfig, World, WorldConfig,
};
use nalgebra::Vector3;

use crate::rig::{Rig, beacon, config, deviation, mean, other, quiet};

fn from_to(from_s: f64, to_s: f64) -> Vec<Interval> {
    vec![Interval { from_s, to_s: Some(to_s) }]
}

/// A drone at 2 m/s with these failures.
fn world(drone: DroneConfig) -> World {
    let vehicle = VehicleConfig::Kinematic(KinematicConfig {
        speed_mps: 2.0,
        climb_mps: 1.0,
        ..KinematicConfig::default()
    });
    let config = WorldConfig { drones: vec![drone], vehicle, ..config(quiet()) };
    World::new(&config, 1).expect("the configuration is in order")
}

fn pass(world: &World, seconds: u32) {
    for _ in 0..10 * seconds {
        world.advance(0.1).expect("a step");
    }
}

fn east(world: &World) -> f64 {
    world.pose(0).expect("it exists").position.x
}

#[test]
fn one_that_is_stuck_hovers_and_follows_its_last_order_afterwards() {
    let world = world(DroneConfig { stuck: from_to(1.95, 5.95), ..DroneConfig::default() });
    let mut vehicle = world.vehicle(0).expect("it exists");
    let order = |east| Waypoint { position: Vector3::new(east, 0.0, 0.0) };
    vehicle.go_to(&order(10.0)).expect("a place");
    pass(&world, 2);
    assert_abs_diff_eq!(east(&world), 4.0, epsilon = 1e-9);
    vehicle.go_to(&order(-10.0)).expect("it is taken note of");
    let nowhere = order(f64::NAN);
    assert!(matches!(vehicle.go_to(&nowhere), Err(SimError::Goal { .. })));
    vehicle.go_to(&order(8.0)).expect("it is taken note of");
    pass(&world, 3);
    assert!(abs_diff_eq!(east(&world), 4.0, epsilon = 1e-9), "it moved");
    pass(&world, 2);
    assert_abs_diff_eq!(east(&world), 6.0, epsilon = 1e-9);
    pass(&world, 5);
    assert_abs_diff_eq!(east(&world), 8.0, epsilon = 1e-9);
}

#[test]
fn a_quadrotor_that_is_stuck_brakes_and_goes_on() {
    let drone = DroneConfig { up_m: 4.0, stuck: from_to(10.0, 20.0), ..DroneConfig::default() };
    let vehicle = VehicleConfig::Quadrotor(QuadrotorConfig::default());
    let config = WorldConfig { drones: vec![drone], vehicle, ..config(quiet()) };
    let world = World::new(&config, 1).expect("in order");
    let position = Vector3::new(60.0, 0.0, 4.0);
    world.vehicle(0).expect("it exists").go_to(&Waypoint { position }).expect("a place");
    pass(&world, 15);
    let stood = east(&world);
    pass(&world, 4);
    assert!(stood > 5.0 && (east(&world) - stood).abs() < 0.2, "{stood} to {}", east(&world));
    pass(&world, 60);
    assert_abs_diff_eq!(east(&world), 60.0, epsilon = 0.2);
}

#[test]
fn one_that_is_lost_answers_nothing_and_flies_on() {
    let world = world(DroneConfig { lost: from_to(1.0, 3.0), ..DroneConfig::default() });
    let mut vehicle = world.vehicle(0).expect("it exists");
    vehicle.go_to(&Waypoint { position: Vector3::new(8.0, 0.0, 0.0) }).expect("a place");
    world.advance(1.0).expect("a step");
    let lost = SimError::Link { drone: 0 };
    assert_eq!(vehicle.pose(), Err(lost.clone()));
    assert_eq!(vehicle.spin(Some(1.0)), Err(lost.clone()));
    assert_eq!(vehicle.pose(), Err(lost.clone()));
    assert_eq!(vehicle.land(), Err(lost.clone()));
    assert_eq!(vehicle.go_to(&Waypoint::default()), Err(lost));
    world.advance(2.0).expect("a step");
    assert_abs_diff_eq!(east(&world), 6.0, epsilon = 1e-9);
    assert_eq!(vehicle.pose(), world.pose(0), "it is back");
}

#[test]
fn one_that_is_silent_flies_and_receives_nothing() {
    let mut config = config(quiet());
    config.drones[0].silent = from_to(1.0, 2.0);
    let mut rig = Rig::new(&config, 1);
    let before = rig.request(0);
    assert!(before.is_some());
    rig.world.advance(1.5).expect("a step");
    assert_eq!(rig.request(0), None);
    rig.world.advance(0.5).expect("a step");
    assert_eq!(rig.request(0), before);
}

#[test]
fn a_late_sweep_is_the_same_sweep_later() {
    let finished = |late_s: f64| {
        let world = world(DroneConfig { late_s, ..DroneConfig::default() });
        let stepper = world.stepper(0, StepperConfig::pritzl2018()).expect("it exists");
        let mut source = world.late(0, stepper).expect("it exists");
        source.begin(&[BeaconId(1), BeaconId(0)]).expect("it turns");
        let mut sweeps = Vec::new();
        while sweeps.len() < 2 {
            world.advance(0.01).expect("a step");
            while let Some(sweep) = source.poll().expect("it works") {
                let samples = sweep.samples.to_vec();
                sweeps.push((world.time(), sweep.beacon, sweep.time, samples));
            }
        }
        assert!(source.poll().expect("it works").is_none());
        sweeps
    };
    for (prompt, late) in finished(0.0).into_iter().zip(finished(7.5)) {
        assert_abs_diff_eq!(late.0 - prompt.0, 7.5, epsilon = 0.011);
        assert_eq!((prompt.1, prompt.2, prompt.3), (late.1, late.2, late.3));
    }
}

#[test]
fn a_turn_gives_up_the_late_sweeps_of_the_one_before() {
    let world = world(DroneConfig { late_s: 5.0, ..DroneConfig::default() });
    let source = world.omnidirectional(0, OmnidirectionalConfig::default()).expect("it exists");
    let mut source = world.late(0, source).expect("it exists");
    pattern_source(&mut source, &[BeaconId(1), BeaconId(0)], 100_000, || {
        world.advance(0.01).expect("a step");
    });
    source.begin(&[BeaconId(0)]).expect("it listens");
    let begun = world.time();
    while world.time() < begun + 4.9 {
        world.advance(0.01).expect("a step");
        assert!(source.poll().expect("it works").is_none());
    }
    source.begin(&[]).expect("it gives up");
    for _ in 0..1000 {
        world.advance(0.01).expect("a step");
        assert!(source.poll().expect("it works").is_none());
    }
}

#[test]
fn a_beacon_that_comes_later_leaves_all_else_as_it_is() {
    let readings = |appears_after_s| {
        let mut config = config(ChannelConfig::default());
        config.beacons[1].appears_after_s = appears_after_s;
        let mut rig = Rig::new(&config, 5);
        let mut readings = Vec::new();
        for _ in 0..4 {
            readings.push((rig.request(0), rig.request(1)));
            rig.world.advance(1.0).expect("a step");
        }
        assert_eq!(rig.world.appears_after_s(BeaconId(1)), appears_after_s);
        assert_eq!(rig.world.appears_after_s(BeaconId(2)), None);
        readings
    };
    for (i, (always, later)) in readings(None).into_iter().zip(readings(Some(2.0))).enumerate() {
        assert_eq!(always.0, later.0);
        assert!(always.1.is_some());
        assert_eq!(later.1, always.1.filter(|_| i >= 2));
    }
}

/// A transmitter that is there with 0.3 is there in 300 of 1000 seeds within 5 standard deviations
/// of a binomial number. It scatters by itself, and changes nothing of the beacon's own place.
#[test]
fn others_on_a_frequency_are_drawn_with_the_seed() {
    let mut config = config(quiet());
    config.beacons[0].scatter_m = Some(20.0);
    let alone: Vec<_> = (0..1000).map(|seed| config.drawn_beacons(seed)[0].place_at(0.0)).collect();
    let scattered = OtherConfig { scatter_m: Some(10.0), presence: 0.3, ..other(70.0) };
    config.beacons[0].others = vec![other(-50.0), scattered];
    let mut there = 0.0;
    let mut east = Vec::new();
    for (seed, alone) in (0..1000).zip(alone) {
        let world = World::new(&config, seed).expect("in order");
        let places = world.transmitters_at(BeaconId(0), 0.0);
        assert_eq!(places[..2], [alone, Vector3::new(-50.0, 0.0, 0.0)]);
        there += f64::from(u8::from(places.len() == 3));
        east.extend(places.get(2).map(|place| place.x - 70.0));
    }
    assert_abs_diff_eq!(there, 300.0, epsilon = 5.0 * (1000.0_f64 * 0.3 * 0.7).sqrt());
    let standard = 10.0 / (2.0_f64 * there).sqrt();
    assert_abs_diff_eq!(deviation(&east), 10.0, epsilon = 5.0 * standard);
}

/// 1000 seeds: the σ of East and North is 20 m within 5 standard errors (20/√2000 m), their mean 0
/// within 5 (20/√1000 m).
#[test]
fn a_beacon_scatters_as_far_as_is_set() {
    let mut config = config(quiet());
    config.beacons.push(beacon(3.0, -4.0, 1.0));
    config.beacons[0].scatter_m = Some(20.0);
    let mut east = Vec::new();
    let mut north = Vec::new();
    for seed in 0..1000 {
        let world = World::new(&config, seed).expect("in order");
        let place = world.truth(BeaconId(0)).expect("it exists");
        assert_eq!(config.drawn_beacons(seed)[0].place_at(0.0), place);
        assert_eq!(world.truth(BeaconId(2)), Some(Vector3::new(3.0, -4.0, 1.0)));
        east.push(place.x - 30.0);
        north.push(place.y - 40.0);
    }
    for values in [&east, &north] {
        assert_abs_diff_eq!(deviation(values), 20.0, epsilon = 5.0 * 20.0 / 2000.0_f64.sqrt());
        assert_abs_diff_eq!(mean(values), 0.0, epsilon = 5.0 * 20.0 / 1000.0_f64.sqrt());
    }
    // The other one's place does not depend on whether the first scatters.
    config.beacons[1].scatter_m = Some(20.0);
    let both = config.drawn_beacons(3)[1].clone();
    config.beacons[0].scatter_m = None;
    assert_eq!(config.drawn_beacons(3)[1], both);
}
