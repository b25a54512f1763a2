use foxhunt_sensors::{AntennaConfig, GainRow, Hill, LogDistance, Polarisation};
use foxhunt_sim::{
    BeaconConfig, BeaconCourse, ChannelConfig, DeadZoneConfig, DroneConfig, Dynamics, Interval,
    KinematicConfig, OtherConfig, PathLossConfig, QuadrotorConfig, ReliefConfig, ScatteringConfig,
    ShadowingConfig, SimError, SimStepperConfig, TwoRayConfig, VehicleConfig, WindConfig, World,
    WorldConfig,
};

use crate::rig::{beacon, config, omnidirectional, other, reflector, scattering};

fn hill(radius_m: f64) -> Hill {
    Hill { east_m: 15.0, north_m: 20.0, height_m: 10.0, radius_m }
}

type Change = fn(&mut WorldConfig, f64);

fn kinematic(speed_mps: f64, climb_mps: f64) -> VehicleConfig {
    VehicleConfig::Kinematic(KinematicConfig { speed_mps, climb_mps, ..KinematicConfig::default() })
}

#[test]
fn a_number_out_of_range_is_refused_by_name() {
    let anything = [f64::NAN, f64::INFINITY];
    let not_negative = [f64::NAN, f64::INFINITY, -1.0];
    let probability = [f64::NAN, -0.1, 1.1];
    let positive = [f64::NAN, f64::INFINITY, -1.0, 0.0].as_slice();
    let below_from = [f64::NAN, f64::INFINITY, 4.9];
    let cases: [(&str, &[f64], Change); 39] = [
        ("beacons[1].east_m", &anything, |c, v| c.beacons[1].east_m = v),
        ("beacons[1].north_m", &anything, |c, v| c.beacons[1].north_m = v),
        ("beacons[0].up_m", &anything, |c, v| c.beacons[0].up_m = v),
        ("drones[0].east_m", &anything, |c, v| c.drones[0].east_m = v),
        ("drones[0].north_m", &anything, |c, v| c.drones[0].north_m = v),
        ("drones[0].up_m", &anything, |c, v| c.drones[0].up_m = v),
        ("drones[0].heading_deg_ccw_from_east", &anything, |c, v| {
            c.drones[0].heading_deg_ccw_from_east = v;
        }),
        ("drones[0].silent_after_s", &not_negative, |c, v| c.drones[0].silent_after_s = Some(v)),
        ("drones[0].late_s", &not_negative, |c, v| c.drones[0].late_s = v),
        ("drones[0].silent[0].from_s", &not_negative, |c, v| {
            c.drones[0].silent = vec![Interval { from_s: v, to_s: None }];
        }),
        ("drones[0].stuck[1].to_s", &below_from, |c, v| {
            let stuck = |to_s| Interval { from_s: 5.0, to_s };
            c.drones[0].stuck = vec![stuck(None), stuck(Some(v))];
        }),
        ("drones[0].lost[0].from_s", &not_negative, |c, v| {
            c.drones[0].lost = vec![Interval { from_s: v, to_s: None }];
        }),
        ("drones[0].lost[0].to_s", &below_from, |c, v| {
            c.drones[0].lost = vec![Interval { from_s: 5.0, to_s: Some(v) }];
        }),
        ("beacons[1].scatter_m", &not_negative, |c, v| c.beacons[1].scatter_m = Some(v)),
        ("beacons[1].others[0].east_m", &anything, |c, v| c.beacons[1].others = vec![other(v)]),
        ("beacons[1].others[0].scatter_m", &not_negative, |c, v| {
            c.beacons[1].others = vec![OtherConfig { scatter_m: Some(v), ..other(1.0) }];
        }),
        ("beacons[1].others[0].presence", &probability, |c, v| {
            c.beacons[1].others = vec![OtherConfig { presence: v, ..other(1.0) }];
        }),
        ("beacons[0].appears_after_s", &not_negative, |c, v| {
            c.beacons[0].appears_after_s = Some(v);
        }),
        ("channel.pattern_sigma_db", &not_negative, |c, v| c.channel.pattern_sigma_db = v),
        ("channel.sample_sigma_db", &not_negative, |c, v| c.channel.sample_sigma_db = v),
        ("channel.bearing_sigma_deg", &not_negative, |c, v| c.channel.bearing_sigma_deg = v),
        ("channel.frequency_mhz", positive, |c, v| c.channel.frequency_mhz = v),
        ("channel.shadowing.sigma_db", &not_negative, |c, v| {
            c.channel.shadowing = Some(ShadowingConfig { sigma_db: v, correlation_m: 20.0 });
        }),
        ("channel.shadowing.correlation_m", positive, |c, v| {
            c.channel.shadowing = Some(ShadowingConfig { sigma_db: 4.0, correlation_m: v });
        }),
        ("channel.reflectors[1].amplitude", &not_negative, |c, v| {
            c.channel.reflectors = vec![reflector(0.5), reflector(v)];
        }),
        ("channel.scattering.k_db", &[f64::NAN, -41.0, 61.0], |c, v| {
            c.channel.scattering = Some(ScatteringConfig { k_db: v, ..scattering() });
        }),
        ("channel.scattering.k_sigma_db", &[f64::NAN, -0.1, 21.0], |c, v| {
            c.channel.scattering = Some(ScatteringConfig { k_sigma_db: v, ..scattering() });
        }),
        ("channel.scattering.elevation_sigma_deg", &[f64::NAN, -0.1, 46.0], |c, v| {
            c.channel.scattering =
                Some(ScatteringConfig { elevation_sigma_deg: v, ..scattering() });
        }),
        ("channel.dead_zones[0].radius_m", positive, |c, v| {
            c.channel.dead_zones = vec![DeadZoneConfig { east_m: 1.0, north_m: 2.0, radius_m: v }];
        }),
        ("channel.floor_dbm", &anything, |c, v| c.channel.floor_dbm = Some(v)),
        ("channel.loss_probability", &[f64::NAN, -0.1, 1.1], |c, v| c.channel.loss_probability = v),
        ("terrain.hills[0].radius_m", positive, |c, v| {
            c.terrain = Some(ReliefConfig::of_hills(vec![hill(v)]));
        }),
        ("terrain.frequency_mhz", positive, |c, v| {
            let mut terrain = ReliefConfig::of_hills(vec![hill(25.0)]);
            terrain.frequency_mhz = Some(v);
            c.terrain = Some(terrain);
        }),
        ("vehicle.speed_mps", positive, |c, v| c.vehicle = kinematic(v, 1.0)),
        ("vehicle.climb_mps", positive, |c, v| c.vehicle = kinematic(1.0, v)),
        ("vehicle.drag_per_s", &not_negative, |c, v| {
            let quadrotor = QuadrotorConfig { drag_per_s: v, ..QuadrotorConfig::default() };
            c.vehicle = VehicleConfig::Quadrotor(quadrotor);
        }),
        ("beacons[1].course.radius_m", positive, |c, v| {
            c.beacons[1].course = Some(BeaconCourse::Circle { radius_m: v, period_s: 10.0 });
        }),
        ("beacons[1].course.places_m", &anything, |c, v| {
            let places_m = vec![[1.0, 2.0], [3.0, v]];
            c.beacons[1].course = Some(BeaconCourse::Round { places_m, speed_mps: 1.0 });
        }),
        ("stepper.rotator_speed_rad_s", positive, |c, v| c.stepper.rotator_speed_rad_s = v),
    ];
    for (name, values, change) in cases {
        for &bad in values {
            let mut config = config(ChannelConfig::default());
            change(&mut config, bad);
            let error = World::new(&config, 1).expect_err(name);
            let SimError::Field(field) = &error else { panic!("{error}") };
            assert_eq!(field.field, name);
            assert_eq!(field.value, bad.to_string());
            assert!(error.to_string().starts_with(name));
        }
    }
    let mut late = config(ChannelConfig::default());
    late.stepper.radio_latency_s = -0.01;
    let error = World::new(&late, 1).expect_err("negative").to_string();
    assert_eq!(error, "stepper.radio_latency_s is -0.01; it must be zero or a positive number");
}

#[test]
fn a_table_that_is_none_is_refused_by_its_row() {
    let mut config = config(ChannelConfig::default());
    config.channel.antenna = AntennaConfig::Table(vec![
        GainRow { angle_deg: 0.0, gain_db: 8.0 },
        GainRow { angle_deg: 90.0, gain_db: f64::NAN },
        GainRow { angle_deg: 180.0, gain_db: -9.0 },
    ]);
    let error = World::new(&config, 1).expect_err("a gain is NaN").to_string();
    assert!(error.starts_with("channel.antenna: row 1"), "{error}");
}

#[test]
fn a_world_comes_back_from_a_file_as_it_went() {
    let full = WorldConfig {
        beacons: vec![BeaconConfig {
            scatter_m: Some(3.0),
            appears_after_s: Some(60.0),
            others: vec![OtherConfig { scatter_m: Some(2.0), presence: 0.25, ..other(5.0) }],
            ..beacon(1.5, -2.5, 0.25)
        }],
        drones: vec![DroneConfig {
            east_m: 1.0,
            north_m: 2.0,
            up_m: 3.0,
            heading_deg_ccw_from_east: 4.0,
            silent_after_s: Some(5.0),
            silent: vec![Interval { from_s: 1.0, to_s: Some(2.0) }],
            stuck: vec![Interval { from_s: 6.0, to_s: None }],
            lost: vec![Interval::default(), Interval { from_s: 7.0, to_s: Some(8.0) }],
            late_s: 9.0,
            level_offset_db: 10.0,
            compass_offset_deg: 11.0,
        }],
        channel: ChannelConfig {
            dead_zones: vec![DeadZoneConfig { east_m: 1.0, north_m: 2.0, radius_m: 3.0 }],
            path_loss: LogDistance::pritzl2018_urban().into(),
            frequency_mhz: 868.0,
            shadowing: Some(ShadowingConfig { sigma_db: 6.0, correlation_m: 20.0 }),
            reflectors: vec![reflector(0.5)],
            scattering: Some(ScatteringConfig { k_sigma_db: 4.0, ..scattering() }),
            antenna: omnidirectional(),
            pattern_sigma_db: 1.0,
            sample_sigma_db: 0.5,
            bearing_sigma_deg: 7.0,
            patterns_stay: true,
            noise_dbm: Some(-113.0),
            whole_db: true,
            floor_dbm: Some(-100.0),
            loss_probability: 0.1,
        },
        terrain: Some(ReliefConfig::of_hills(vec![hill(25.0)])),
        vehicle: kinematic(5.0, 3.0),
        stepper: SimStepperConfig { rotator_speed_rad_s: 1.5, radio_latency_s: 0.05 },
    };
    let circle = BeaconCourse::Circle { radius_m: 2.0, period_s: 60.0 };
    let round = BeaconCourse::Round { places_m: vec![[1.0, 2.0]], speed_mps: 0.5 };
    let moving = |course| BeaconConfig { course: Some(course), ..beacon(1.0, 2.0, 0.0) };
    let wind = WindConfig { east_mps: 3.0, gust_sigma_mps: 1.0, ..WindConfig::default() };
    let quadrotor = QuadrotorConfig { speed_mps: 1.5, wind, ..QuadrotorConfig::default() };
    let flying = WorldConfig {
        beacons: vec![moving(circle), moving(round)],
        vehicle: VehicleConfig::Quadrotor(quadrotor),
        ..WorldConfig::default()
    };
    for config in [full, flying, WorldConfig::default()] {
        let text = serde_json::to_string(&config).expect("plain fields");
        assert_eq!(serde_json::from_str::<WorldConfig>(&text).expect(&text), config);
    }
}

#[test]
fn what_a_file_leaves_out_has_its_default() {
    let text = r#"{
        "beacons": [{ "name": "fox", "east_m": 1, "north_m": 2 }],
        "drones": [{ "east_m": 3, "north_m": 4 }],
        "channel": { "antenna": "reference-patch", "floor_dbm": -100 }
    }"#;
    let config: WorldConfig = serde_json::from_str(text).expect("all that has no default is there");
    let channel = ChannelConfig { floor_dbm: Some(-100.0), ..ChannelConfig::default() };
    let expected = WorldConfig {
        beacons: vec![beacon(1.0, 2.0, 0.0)],
        drones: vec![DroneConfig { east_m: 3.0, north_m: 4.0, ..DroneConfig::default() }],
        channel,
        ..WorldConfig::default()
    };
    assert_eq!(config, expected);
}

#[test]
fn scattering_is_refused_without_waves_and_has_six_unless_given() {
    let read = |text: &str| serde_json::from_str::<ScatteringConfig>(text);
    assert_eq!(read(r#"{ "k_db": 0.0 }"#).expect("all others have defaults"), scattering());
    assert!(read(r#"{ "k_sigma_db": 4.0 }"#).expect_err("no K").to_string().contains("k_db"));
    let none = ScatteringConfig { waves: 0, ..scattering() };
    let channel = ChannelConfig { scattering: Some(none), ..ChannelConfig::default() };
    let error = World::new(&config(channel), 1).expect_err("no waves").to_string();
    assert!(error.starts_with("channel.scattering.waves is 0"), "{error}");
}

#[test]
fn the_default_channel_is_that_of_the_reference() {
    // The simulation of Pritzl 2018, §6.1, with the open field's law of §7.1.
    let text = r#"{
        "path_loss": { "reference_dbm": -29.06, "exponent": 2.765 },
        "antenna": "reference-patch",
        "pattern_sigma_db": 4, "sample_sigma_db": 2, "bearing_sigma_deg": 30,
        "whole_db": false, "loss_probability": 0
    }"#;
    let channel: ChannelConfig = serde_json::from_str(text).expect("all fields are known");
    assert_eq!(ChannelConfig::default(), channel);
}

#[test]
fn every_law_of_propagation_comes_from_a_file() {
    let read = |text: &str| serde_json::from_str::<PathLossConfig>(text);
    let two_ray = TwoRayConfig {
        permittivity: 4.0,
        polarisation: Polarisation::Horizontal,
        ..TwoRayConfig::new(13.0)
    };
    for (text, law) in [
        (r#"{"reference_dbm":-30.0,"exponent":2.5}"#, LogDistance::new(-30.0, 2.5).map(Into::into)),
        (r#"{"law":"friis","power_dbm":13.0}"#, Ok(PathLossConfig::Friis { power_dbm: 13.0 })),
        (
            r#"{"law":"two-ray","power_dbm":13.0,"permittivity":4.0,"polarisation":"horizontal","least_height_m":0.1}"#,
            Ok(PathLossConfig::TwoRay(two_ray)),
        ),
    ] {
        let law = law.expect("in range");
        assert_eq!(read(text).expect(text), law);
        assert_eq!(serde_json::to_string(&law).expect("plain fields"), text);
    }
    for (text, reported) in [
        (r#"{"exponent":2.5}"#, "reference_dbm is missing for the law log-distance"),
        (r#"{"law":"two-ray"}"#, "power_dbm is missing for the law two-ray"),
        (r#"{"law":"friis","power_dbm":1,"exponent":2}"#, "friis does not use exponent"),
        (r#"{"law":"okumura"}"#, "okumura"),
        (r#"{"law":"friis","power":1}"#, "`power`"),
    ] {
        let error = read(text).expect_err(text).to_string();
        assert!(error.contains(reported), "{error}");
    }
    let refused = |path_loss| {
        let channel = ChannelConfig { path_loss, ..ChannelConfig::default() };
        World::new(&config(channel), 1).expect_err("out of range").to_string()
    };
    let dry = TwoRayConfig { permittivity: 0.5, ..two_ray };
    assert!(refused(PathLossConfig::TwoRay(dry)).starts_with("channel.path_loss: permittivity"));
    let flat = TwoRayConfig { least_height_m: -1.0, ..two_ray };
    assert!(refused(PathLossConfig::TwoRay(flat)).contains("height"));
    assert!(refused(PathLossConfig::Friis { power_dbm: f64::NAN }).contains("power_dbm"));
}

#[test]
fn a_typo_is_named() {
    let whole = r#"{ "beacons": [{ "name": "fox", "east_m": 1, "north_m": 2 }],
        "drones": [{ "east_m": 3, "north_m": 4 }],
        "channel": { "path_loss": { "reference_dbm": -30, "exponent": 2 },
            "antenna": { "table": [{ "angle_deg": 0, "gain_db": 8 }] }, "whole_db": true },
        "vehicle": { "speed_mps": 1 }, "stepper": { "radio_latency_s": 0.1 } }"#;
    serde_json::from_str::<WorldConfig>(whole).expect("as it should be");
    for (right, wrong) in [
        ("drones", "drone"),
        ("north_m", "north"),
        ("name", "nane"),
        ("whole_db", "whole_dB"),
        ("exponent", "gamma"),
        ("gain_db", "gain_dbi"),
        ("table", "tabel"),
        ("speed_mps", "speed"),
        ("radio_latency_s", "latency_s"),
        ("vehicle", "vehicles"),
    ] {
        let text = whole.replace(&format!("\"{right}\""), &format!("\"{wrong}\""));
        let error = serde_json::from_str::<WorldConfig>(&text).expect_err(wrong).to_string();
        assert!(error.contains(&format!("`{wrong}`")), "{error}");
    }
    let negative = whole.replace("\"exponent\": 2", "\"exponent\": -2");
    let error = serde_json::from_str::<WorldConfig>(&negative).expect_err("negative").to_string();
    assert!(error.contains("exponent is -2"), "{error}");
}

#[test]
fn a_vehicle_is_of_the_kind_in_its_file() {
    let read = |text: &str| serde_json::from_str::<VehicleConfig>(text);
    let reported = |text: &str| read(text).expect_err(text).to_string();
    assert_eq!(read(r#"{ "speed_mps": 3 }"#).expect("as before"), kinematic(3.0, 1.0));
    let slow = QuadrotorConfig { speed_mps: 0.5, ..QuadrotorConfig::default() };
    let text = r#"{ "kind": "quadrotor", "speed_mps": 0.5 }"#;
    assert_eq!(read(text).expect("a quadrotor"), VehicleConfig::Quadrotor(slow));
    assert!(reported(r#"{ "kind": "kinematic", "wind": {} }"#).starts_with("wind is of a vehicle"));
    let rigid = QuadrotorConfig {
        dynamics: Dynamics::RigidBody,
        inertia_kg_m2: Some([0.002, 0.003, 0.004]),
        ..QuadrotorConfig::default()
    };
    let text = r#"{ "kind": "quadrotor", "dynamics": "rigid-body",
        "inertia_kg_m2": [0.002, 0.003, 0.004] }"#;
    assert_eq!(read(text).expect("a rigid body"), VehicleConfig::Quadrotor(rigid));
    let text = r#"{ "dynamics": "rigid-body" }"#;
    assert!(reported(text).starts_with("dynamics is of a vehicle"));
    assert!(reported(r#"{ "kind": "quadrotor", "wnd": {} }"#).contains("wnd"));
    assert!(reported(r#"{ "kind": "balloon" }"#).contains("balloon"));
}

#[test]
fn beacons_follow_their_course() {
    let at = |course: BeaconCourse, time: f64| {
        let beacon = BeaconConfig { course: Some(course), ..beacon(5.0, 2.0, 1.0) };
        let mut config = config(ChannelConfig::default());
        config.beacons = vec![beacon.clone()];
        let world = World::new(&config, 1).expect("in order");
        world.advance(time).expect("a step");
        let place = world.truth(foxhunt_core::BeaconId(0)).expect("it exists");
        assert_eq!(place, beacon.place_at(time));
        (place.x, place.y, place.z)
    };
    let near = |a: (f64, f64, f64), b: (f64, f64, f64)| {
        (a.0 - b.0).abs() + (a.1 - b.1).abs() + (a.2 - b.2).abs() < 1e-9
    };
    let circle = || BeaconCourse::Circle { radius_m: 3.0, period_s: 40.0 };
    for (time, place) in [(0.0, (5.0, 2.0)), (10.0, (2.0, 5.0)), (20.0, (-1.0, 2.0))] {
        assert!(near(at(circle(), time), (place.0, place.1, 1.0)), "after {time} s");
    }
    // 6 m, 8 m and 10 m back, at 2 m/s.
    let round =
        || BeaconCourse::Round { places_m: vec![[11.0, 2.0], [11.0, 10.0]], speed_mps: 2.0 };
    for (time, place) in
        [(1.5, (8.0, 2.0)), (5.0, (11.0, 6.0)), (9.5, (8.0, 6.0)), (13.5, (8.0, 2.0))]
    {
        assert!(near(at(round(), time), (place.0, place.1, 1.0)), "after {time} s");
    }
    let nowhere = BeaconCourse::Round { places_m: Vec::new(), speed_mps: 2.0 };
    assert!(near(at(nowhere, 7.0), (5.0, 2.0, 1.0)));
}
