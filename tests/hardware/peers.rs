//! Our drivers against programs of others, which `.ci/peers` starts.

use std::{env, thread, time::Duration};

use foxhunt::{
    hardware::{
        Aircraft, AircraftState, MavlinkConfig, MavlinkOrigin, MavlinkVehicle, SystemClock,
    },
    wire::{Endpoint, mavlink::Autopilot},
};
use foxhunt_core::{Clock, Vehicle, Waypoint, angle};
use nalgebra::Vector3;

/// The endpoint that a script put into the environment.
fn endpoint(variable: &str) -> Endpoint {
    let text = env::var(variable).expect("the script that starts the peer sets it");
    text.parse().expect("an endpoint")
}

#[test]
#[ignore = "needs .ci/peers/mavlink_server.py at FOXHUNT_PEER_MAVLINK"]
fn an_autopilot_of_mavsdk_is_flown() {
    let clock = SystemClock::start();
    let config = MavlinkConfig {
        // It calls itself a generic one, with the modes of PX4.
        autopilot: Some(Autopilot::Px4),
        origin: Some(MavlinkOrigin { lat_deg: 47.397_742, lon_deg: 8.545_594 }),
        pose_rate_hz: 5.0,
        ..MavlinkConfig::default()
    };
    let stream = endpoint("FOXHUNT_PEER_MAVLINK").open().expect("a port");
    let mut vehicle = MavlinkVehicle::new(config, stream, clock).expect("a driver");
    let until = |vehicle: &mut MavlinkVehicle<_, _>,
                 what: &str,
                 holds: &dyn Fn(&AircraftState, Option<Vector3<f64>>) -> bool| {
        let begun = clock.now();
        loop {
            let state = vehicle.state().expect("a link");
            let place = vehicle.pose().ok().map(|pose| pose.position);
            if holds(&state, place) {
                return;
            }
            let texts: Vec<_> = vehicle.texts().collect();
            assert!(clock.now() - begun < 60.0, "{what}: {state:?} at {place:?}, {texts:?}");
            thread::sleep(Duration::from_millis(20));
        }
    };
    until(&mut vehicle, "ready", &|state, _| state.silent_s < 1.0 && state.hindrance.is_empty());
    vehicle.take_off(6.0).expect("accepted");
    until(&mut vehicle, "up", &|state, place| {
        state.commanded && place.is_some_and(|place| (place.z - 6.0).abs() < 0.6)
    });
    let goal = Vector3::new(12.0, -7.0, 9.0);
    vehicle.go_to(&Waypoint { position: goal }).expect("accepted");
    until(&mut vehicle, "there", &|_, place| {
        place.is_some_and(|place| (place - goal).norm() < 0.5)
    });
    vehicle.turn_to(2.0).expect("accepted");
    let begun = clock.now();
    while !vehicle.is_turned().unwrap_or(false) {
        assert!(clock.now() - begun < 30.0, "it does not turn: {:?}", vehicle.pose());
        thread::sleep(Duration::from_millis(20));
    }
    let heading = vehicle.pose().expect("a pose").heading;
    assert!(angle::distance(heading, 2.0) < 0.1, "{heading}");
    vehicle.land().expect("accepted");
    until(&mut vehicle, "down", &|state, _| !state.armed && !state.airborne);
    println!("our driver flew MAVSDK's autopilot: armed, 6 m up, to a place and a heading, landed");
}

/// Flies it; `.ci/peers/mavlink_strict.py` compares its true height.
#[test]
#[ignore = "needs .ci/peers/mavlink_strict.py at the endpoints of FOXHUNT_PEER_STRICT"]
fn strict_px4s_are_flown_at_their_heights() {
    let endpoints =
        env::var("FOXHUNT_PEER_STRICT").expect("the script that starts the peer sets it");
    for endpoint in endpoints.split(',') {
        let clock = SystemClock::start();
        let config = MavlinkConfig {
            origin: Some(MavlinkOrigin { lat_deg: 47.397_742, lon_deg: 8.545_594 }),
            ..MavlinkConfig::default()
        };
        let endpoint: Endpoint = endpoint.parse().expect("an endpoint");
        let stream = endpoint.open().expect("a port");
        let mut vehicle = MavlinkVehicle::new(config, stream, clock).expect("a driver");
        let until = |vehicle: &mut MavlinkVehicle<_, _>,
                     what: &str,
                     seconds: f64,
                     holds: &dyn Fn(&AircraftState) -> bool| {
            let begun = clock.now();
            loop {
                let state = vehicle.state().expect("a link");
                if holds(&state) {
                    return state;
                }
                let texts: Vec<_> = vehicle.texts().collect();
                assert!(clock.now() - begun < seconds, "{what}: {state:?}, {texts:?}");
                thread::sleep(Duration::from_millis(20));
            }
        };
        until(&mut vehicle, "ready", 60.0, &|state| {
            state.silent_s < 1.0 && state.hindrance.is_empty()
        });
        vehicle.take_off(4.0).expect("accepted");
        until(&mut vehicle, "up", 60.0, &|state| state.commanded);
        for goal in [[4.0, 3.0, 4.0], [8.0, 3.0, 6.0], [3.0, 0.0, 3.0]] {
            let position = Vector3::from(goal);
            vehicle.go_to(&Waypoint { position }).expect("accepted");
            let begun = clock.now();
            let state = until(&mut vehicle, "there", 30.0, &|_| clock.now() - begun > 9.0);
            assert!(state.commanded && state.hindrance.is_empty(), "{state:?}");
            let place = vehicle.pose().expect("a pose").position;
            assert!((place - position).norm() < 0.3, "{place} instead of {position}");
        }
        vehicle.land().expect("accepted");
        until(&mut vehicle, "down", 60.0, &|state| !state.armed && !state.airborne);
    }
}
