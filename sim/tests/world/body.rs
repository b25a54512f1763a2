//! Drones that turn as a whole.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use foxhunt_core::{
    BeaconId, BearingExtractor, PatternSource, Sample, Spinner, Vehicle, Waypoint, angle, laws,
};
use foxhunt_sensors::{
    BodyConfig, MaximumLikelihood, OmnidirectionalConfig, PatternTable, Pritzl2018, StepperConfig,
};
use foxhunt_sim::{
    ChannelConfig, DroneConfig, PulseTrain, QuadrotorConfig, SimError, SimStepperConfig,
    VehicleConfig, WindConfig, World, WorldConfig,
};
use nalgebra::Vector3;

use crate::rig::{config, deviation, quiet};

/// One drone 4 m up whose radio takes 10 ms, and that flies by `vehicle`.
fn flying(vehicle: VehicleConfig, channel: ChannelConfig) -> WorldConfig {
    WorldConfig {
        drones: vec![DroneConfig { up_m: 4.0, ..DroneConfig::default() }],
        vehicle,
        stepper: SimStepperConfig::default(),
        ..config(channel)
    }
}

fn quadrotor() -> VehicleConfig {
    VehicleConfig::Quadrotor(QuadrotorConfig::default())
}

/// Polls every 10 ms until the sweeps of `beacons` are there.
fn sweeps<S: PatternSource>(
    world: &World,
    source: &mut S,
    beacons: &[BeaconId],
) -> Vec<Vec<Sample>> {
    source.begin(beacons).expect("it begins");
    let mut readings = Vec::new();
    for _ in 0..10_000 {
        world.advance(0.01).expect("a step");
        while let Some(sweep) = source.poll().expect("nothing fails") {
            readings.push(sweep.samples.to_vec());
        }
        if readings.len() == beacons.len() {
            return readings;
        }
    }
    panic!("the turn did not end");
}

#[test]
fn both_kinds_of_body_keep_the_laws_of_a_source() {
    for vehicle in [VehicleConfig::default(), quadrotor()] {
        let world = World::new(&flying(vehicle, ChannelConfig::default()), 3).expect("in order");
        let mut body = world.body(0, BodyConfig::isaacs2014()).expect("it exists");
        let mut level = world.omnidirectional(0, OmnidirectionalConfig::default()).expect("so");
        let beacons = [BeaconId(1), BeaconId(0)];
        laws::pattern_source(&mut body, &beacons, 6000, || world.advance(0.01).expect("a step"));
        laws::pattern_source(&mut level, &beacons, 6000, || world.advance(0.01).expect("a step"));
        let none = BodyConfig { positions: 0, ..BodyConfig::isaacs2014() };
        assert!(matches!(world.body(0, none), Err(SimError::Source(_))));
        assert!(world.body(1, BodyConfig::isaacs2014()).is_err());
        let mut vehicle = world.vehicle(0).expect("it exists");
        assert!(matches!(vehicle.spin(Some(f64::NAN)), Err(SimError::SpinRate { .. })));
    }
}

/// A sample's power follows from its own place, boresight and time: nothing is attributed to
/// another moment.
#[test]
fn samples_taken_in_flight_belong_to_where_and_when_they_were_taken() {
    let patch = foxhunt_sensors::AntennaConfig::ReferencePatch.build().expect("built in");
    for vehicle in [VehicleConfig::default(), quadrotor()] {
        let world = World::new(&flying(vehicle, quiet()), 3).expect("in order");
        let mut source = world.body(0, BodyConfig::isaacs2014()).expect("it exists");
        let mut drone = world.vehicle(0).expect("it exists");
        let goal = Vector3::new(6.0, -6.0, 4.0);
        drone.go_to(&Waypoint { position: goal }).expect("a place");
        let readings = sweeps(&world, &mut source, &[BeaconId(0)]).remove(0);
        assert!(readings.len() > 380, "{} samples in 4 s", readings.len());
        let flown = readings[readings.len() - 1].receiver.position - readings[0].receiver.position;
        assert!(flown.norm() > 4.0, "it flew {} m meanwhile", flown.norm());
        let mean = patch.mean_gain_db(0.0);
        for sample in &readings {
            let sight = Vector3::new(30.0, 40.0, 0.0) - sample.receiver.position;
            let body = sample.receiver.to_body(&sight);
            let off = body.y.atan2(body.x) - (sample.boresight - sample.receiver.heading);
            let expected = -29.06 - 27.65 * sight.norm().log10() + patch.gain_dbi(off, 0.0) - mean;
            assert_abs_diff_eq!(sample.rss_dbm, expected, epsilon = 1e-9);
        }
    }
}

#[test]
fn beacons_that_share_a_turn_are_received_with_a_pattern_each() {
    let channel =
        ChannelConfig { pattern_sigma_db: 4.0, antenna: crate::rig::omnidirectional(), ..quiet() };
    let world = World::new(&flying(VehicleConfig::default(), channel), 5).expect("in order");
    let mut source = world.body(0, BodyConfig::isaacs2014()).expect("it exists");
    let beacons = [BeaconId(0), BeaconId(1)];
    let mut offsets = Vec::new();
    for _ in 0..3 {
        for (beacon, readings) in beacons.iter().zip(sweeps(&world, &mut source, &beacons)) {
            let place = world.truth(*beacon).expect("it exists");
            let offset = |sample: &Sample| {
                let range = (place - sample.receiver.position).norm();
                sample.rss_dbm + 29.06 + 27.65 * range.log10()
            };
            let first = offset(&readings[0]);
            assert!(readings.iter().all(|sample| (offset(sample) - first).abs() < 1e-6));
            assert!(offsets.iter().all(|other: &f64| (other - first).abs() > 1e-3));
            offsets.push(first);
        }
    }
}

#[test]
fn a_level_without_a_direction_is_that_of_the_law() {
    let world = World::new(&flying(VehicleConfig::default(), quiet()), 5).expect("in order");
    let mut source = world.omnidirectional(0, OmnidirectionalConfig::default()).expect("so");
    let readings = sweeps(&world, &mut source, &[BeaconId(0)]).remove(0);
    assert_eq!(readings.len(), 768);
    let law = -29.06 - 27.65 * Vector3::<f64>::new(30.0, 40.0, 4.0).norm().log10();
    assert!(readings.iter().all(|sample| abs_diff_eq!(sample.rss_dbm, law, epsilon = 1e-9)));
}

/// The bearing errors of `count` turns in radians, each with a world and a seed of its own: of the
/// reference's extractor, and of maximum likelihood, which is the best.
fn errors<S: PatternSource>(
    config: &WorldConfig,
    count: u64,
    make: impl Fn(&World) -> S,
) -> [Vec<f64>; 2] {
    let reference = Pritzl2018::default();
    let best = MaximumLikelihood::new(PatternTable::reference_patch());
    let extractors: [&dyn BearingExtractor; 2] = [&reference, &best];
    let errors = (0..count)
        .map(|seed| {
            let world = World::new(config, seed).expect("in order");
            let mut source = make(&world);
            source.begin(&[BeaconId(0)]).expect("it begins");
            loop {
                world.advance(0.01).expect("a step");
                let Some(sweep) = source.poll().expect("nothing fails") else { continue };
                break extractors.map(|extractor| {
                    let reading = extractor.extract(&sweep).expect("everything is readings");
                    let bearing = reading.bearing.expect("a lobe").angle;
                    angle::wrap(bearing - 40.0_f64.atan2(30.0))
                });
            }
        })
        .collect::<Vec<_>>();
    [0, 1].map(|which| errors.iter().map(|error| error[which]).collect())
}

/// 300 turns each from seed 0. σ of a root mean square of 300 is 4.1 %, of the ratio of two 5.8 %:
/// the published bound of 20 % is 3.4 of these.
#[test]
fn a_turn_of_the_quadrotor_is_as_good_as_one_of_the_stepper() {
    let wind = WindConfig { east_mps: 2.0, gust_sigma_mps: 0.5, ..WindConfig::default() };
    let windy = QuadrotorConfig { wind, ..QuadrotorConfig::default() };
    let channel = ChannelConfig { sample_sigma_db: 2.0, ..quiet() };
    let hovering = flying(VehicleConfig::default(), channel.clone());
    // 128 positions of 3 samples, and 400 samples in 4 s.
    let three = StepperConfig::pritzl2018().with_samples_per_position(3).expect("positive");
    let stepped = errors(&hovering, 300, |world| world.stepper(0, three).expect("it exists"));
    for vehicle in [quadrotor(), VehicleConfig::Quadrotor(windy)] {
        let config = flying(vehicle, channel.clone());
        let turned = errors(&config, 300, |world| {
            world.body(0, BodyConfig::isaacs2014()).expect("it exists")
        });
        for (stepped, turned) in stepped.iter().zip(&turned) {
            let [stepped, turned] = [stepped, turned].map(|e| deviation(e).to_degrees());
            println!("stepper {stepped:.3}° rms, quadrotor {turned:.3}° rms");
            assert_abs_diff_eq!(turned / stepped, 1.0, epsilon = 0.2);
        }
    }
}

/// A tag that pulses by itself: each pulse is one sample, at the time of the pulse, and pulses that
/// were due and did not come are unanswered; requests in between are neither.
#[test]
fn each_pulse_of_a_tag_is_a_sample_or_a_miss() {
    let pulses = PulseTrain { pulse_s: 0.02, interval_s: 1.3, jitter_s: 0.005, phase_s: 0.4 };
    let mut floor_dbm = None;
    for all_come in [true, false] {
        let mut config = flying(VehicleConfig::default(), ChannelConfig { floor_dbm, ..quiet() });
        config.beacons[0].pulses = Some(pulses);
        let world = World::new(&config, 7).expect("in order");
        let slow = BodyConfig {
            rate_rad_s: std::f64::consts::TAU / 40.0,
            turn_timeout_s: 60.0,
            interval_s: Some(1.3),
            ..BodyConfig::isaacs2014()
        };
        let mut source = world.body(0, slow).expect("it exists");
        source.begin(&[BeaconId(0)]).expect("it begins");
        let (samples, unanswered) = loop {
            world.advance(0.01).expect("a step");
            if let Some(sweep) = source.poll().expect("nothing fails") {
                break (sweep.samples.to_vec(), sweep.unanswered.to_vec());
            }
        };
        // 40 s of 1.3 s.
        let due = samples.len() + unanswered.len();
        assert!((29..=31).contains(&due), "{} samples, {} misses", samples.len(), unanswered.len());
        assert_eq!(unanswered.is_empty(), all_come, "{floor_dbm:?}: {}", unanswered.len());
        for sample in &samples {
            let number = (sample.time - 0.4) / 1.3;
            // A request is at most 50 ms older than the end of its pulse.
            assert!(abs_diff_eq!(number, number.round(), epsilon = 0.06), "{}", sample.time);
        }
        // The weaker half of them lies below the next one's floor.
        let mut levels: Vec<f64> = samples.iter().map(|sample| sample.rss_dbm).collect();
        levels.sort_by(f64::total_cmp);
        floor_dbm = Some(levels[levels.len() / 2]);
    }
}
