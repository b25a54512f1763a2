use approx::assert_abs_diff_eq;
use foxhunt_core::{BeaconId, Clock, Pose, Radio, Rotator, Vehicle, Waypoint};
use foxhunt_sim::{
    ChannelConfig, DroneConfig, KinematicConfig, SimError, VehicleConfig, World, WorldConfig,
};
use nalgebra::Vector3;

use crate::rig::{config, omnidirectional, quiet};

fn world(change: impl FnOnce(&mut WorldConfig)) -> World {
    let mut config = config(ChannelConfig { antenna: omnidirectional(), ..quiet() });
    change(&mut config);
    World::new(&config, 1).expect("the configuration is in order")
}

#[test]
fn an_answer_comes_once_and_late() {
    let world = world(|config| config.stepper.radio_latency_s = 1.0);
    let mut radio = world.radio(0).expect("it exists");
    assert_eq!(radio.poll(), Ok(None));
    radio.request(BeaconId(0)).expect("it exists");
    for _ in 0..9 {
        world.advance(0.1).expect("a step");
        assert_eq!(radio.poll(), Ok(None));
    }
    // Ten times 0.1 falls short of 1 in binary; that must not cost a step more.
    world.advance(0.1).expect("a step");
    assert!(world.time() < 1.0);
    assert!(matches!(radio.poll(), Ok(Some(rss)) if rss < -70.0));
    assert_eq!(radio.poll(), Ok(None));
}

#[test]
fn a_new_question_gives_up_the_old_one() {
    let world = world(|config| config.stepper.radio_latency_s = 0.03);
    let mut radio = world.radio(0).expect("it exists");
    radio.request(BeaconId(0)).expect("it exists");
    world.advance(0.02).expect("a step");
    radio.request(BeaconId(1)).expect("it exists");
    world.advance(0.02).expect("a step");
    assert_eq!(radio.poll(), Ok(None), "the answer to the first would be here");
    world.advance(0.02).expect("a step");
    assert!(matches!(radio.poll(), Ok(Some(rss)) if rss > -50.0), "the near one's");
    assert_eq!(radio.poll(), Ok(None));
    assert_eq!(radio.request(BeaconId(2)), Err(SimError::Beacon { beacon: 2, beacons: 2 }));
}

#[test]
fn a_silent_drone_flies_and_receives_nothing() {
    let world = world(|config| {
        config.drones[0].silent_after_s = Some(5.0);
        config.stepper.radio_latency_s = 0.5;
    });
    let mut radio = world.radio(0).expect("it exists");
    let mut vehicle = world.vehicle(0).expect("it exists");
    let mut readings = Vec::new();
    for _ in 0..12 {
        radio.request(BeaconId(0)).expect("it exists");
        world.advance(0.5).expect("a step");
        readings.push(radio.poll().expect("it works").is_some());
    }
    // Nine answers come before 5 s, the tenth would come just then.
    assert_eq!(readings.iter().filter(|h| **h).count(), 9);
    assert!(readings[..9].iter().all(|h| *h));
    vehicle.go_to(&Waypoint { position: Vector3::new(1.0, 0.0, 0.0) }).expect("a place");
    world.advance(1.0).expect("a step");
    assert_eq!(vehicle.pose(), Ok(Pose::at(1.0, 0.0, 0.0)));
}

#[test]
fn the_antenna_takes_its_time() {
    let world = world(|config| config.stepper.rotator_speed_rad_s = 0.5);
    let mut rotator = world.rotator(0).expect("it exists");
    assert_eq!(rotator.poll(), Ok(Some(0.0)));
    rotator.turn_to(7.0).expect("finite");
    world.advance(13.9).expect("a step");
    assert_eq!(rotator.poll(), Ok(None));
    assert!(rotator.turn_to(f64::NAN).is_err());
    world.advance(0.1).expect("a step");
    assert_eq!(rotator.poll(), Ok(Some(7.0)), "the refused order changed nothing");
}

#[test]
fn drones_arrive_in_the_time_of_distance_and_speed() {
    let world = world(|config| {
        config.vehicle = VehicleConfig::Kinematic(KinematicConfig {
            speed_mps: 2.5,
            climb_mps: 1.0,
            ..KinematicConfig::default()
        });
        config.drones =
            vec![DroneConfig::default(), DroneConfig { east_m: 9.0, ..DroneConfig::default() }];
    });
    assert_eq!(world.vehicle(1).and_then(|mut v| v.pose()), Ok(Pose::at(9.0, 0.0, 0.0)));
    // 25 m over ground: 10 s. 15 m up: 15 s.
    let goals = [Vector3::new(15.0, 20.0, 4.0), Vector3::new(9.0, 5.0, 15.0)];
    for (drone, position) in goals.into_iter().enumerate() {
        world.vehicle(drone).and_then(|mut v| v.go_to(&Waypoint { position })).expect("a place");
    }
    let mut arrived = [None; 2];
    for _ in 0..2000 {
        world.advance(0.01).expect("a step");
        for (drone, (goal, arrived)) in goals.iter().zip(&mut arrived).enumerate() {
            if arrived.is_none()
                && world.vehicle(drone).and_then(|mut v| v.pose()).expect("it exists").position
                    == *goal
            {
                *arrived = Some(world.clock().now());
            }
        }
    }
    for (found, expected) in arrived.iter().zip([10.0, 15.0]) {
        let found = found.expect("it arrived");
        assert_abs_diff_eq!(found, expected, epsilon = 0.011);
    }
    for (drone, flown) in [(0, 641.0_f64.sqrt()), (1, 250.0_f64.sqrt())] {
        assert_abs_diff_eq!(world.path_length(drone).expect("it exists"), flown, epsilon = 1e-9);
    }
}

#[test]
fn a_drone_that_cannot_do_it_stays_and_the_others_go() {
    let world = world(|config| config.drones = vec![DroneConfig::default(); 2]);
    let nowhere = Waypoint { position: Vector3::new(f64::NAN, 0.0, 0.0) };
    assert!(matches!(
        world.vehicle(0).and_then(|mut v| v.go_to(&nowhere)),
        Err(SimError::Goal { .. })
    ));
    let missing = SimError::Drone { drone: 2, drones: 2 };
    assert_eq!(
        world.vehicle(2).and_then(|mut v| v.go_to(&Waypoint::default())),
        Err(missing.clone())
    );
    assert_eq!(world.vehicle(2).and_then(|mut v| v.land()), Err(missing.clone()));
    assert_eq!(world.vehicle(2).and_then(|mut v| v.pose()), Err(missing));
    world
        .vehicle(1)
        .and_then(|mut v| v.go_to(&Waypoint { position: Vector3::new(3.0, 0.0, 0.5) }))
        .expect("a place");
    world.advance(2.0).expect("a step");
    world.vehicle(1).and_then(|mut v| v.land()).expect("it flies");
    world.advance(1.0).expect("a step");
    assert_eq!(world.vehicle(0).and_then(|mut v| v.pose()), Ok(Pose::default()));
    assert_eq!(world.vehicle(1).and_then(|mut v| v.pose()), Ok(Pose::at(3.0, 0.0, 0.0)));
}

#[test]
fn what_is_not_there_cannot_be_had() {
    let world = world(|_| {});
    let missing = SimError::Drone { drone: 1, drones: 1 };
    assert_eq!(world.radio(1).err(), Some(missing.clone()));
    assert_eq!(world.rotator(1).err(), Some(missing.clone()));
    assert_eq!(world.vehicle(1).err(), Some(missing.clone()));
    assert_eq!(world.path_length(1), Err(missing));
    assert_eq!(world.truth(BeaconId(1)), Some(Vector3::new(-5.0, 0.0, 0.0)));
    assert_eq!(world.truth(BeaconId(2)), None);
    assert_eq!(world.drone_count(), 1);
}

#[test]
fn time_does_not_run_back() {
    let world = world(|_| {});
    world.advance(2.0).expect("a step");
    for dt in [-1e-3, f64::NAN, f64::INFINITY] {
        assert!(matches!(world.advance(dt), Err(SimError::TimeStep { .. })), "{dt}");
    }
    world.advance(0.0).expect("no time at all");
    assert_eq!(world.time().to_bits(), 2.0_f64.to_bits());
}
