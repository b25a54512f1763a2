use foxhunt::{
    core::{BeaconId, BearingExtractor, PatternSource, angle},
    hardware::{FirmataConfig, FirmataStepper},
    sensors::{FirstHarmonic, StepperConfig, StepperSource},
    sim::{
        BeaconConfig, ChannelConfig, DroneConfig, EmulatedStepper, EmulatedStepperConfig, Emulator,
        World, WorldConfig,
    },
    wire::memory_pair,
};

const TURNS: usize = 4;

fn world(channel: ChannelConfig) -> World {
    let beacon = BeaconConfig {
        name: "fox".to_owned(),
        east_m: 15.0,
        north_m: 12.0,
        ..BeaconConfig::default()
    };
    let config = WorldConfig {
        beacons: vec![beacon],
        drones: vec![DroneConfig { up_m: 4.0, ..DroneConfig::default() }],
        channel,
        ..WorldConfig::default()
    };
    World::new(&config, 5).expect("it is in order")
}

fn bearings<P: PatternSource>(world: &World, source: &mut P, mut serve: impl FnMut()) -> Vec<f64> {
    let extractor = FirstHarmonic::default();
    (0..TURNS)
        .map(|_| {
            assert!(source.begin(&[BeaconId(0)]).is_ok());
            for _ in 0..20_000 {
                world.advance(0.005).expect("a step");
                serve();
                let Ok(polled) = source.poll() else { panic!("nothing fails") };
                if let Some(sweep) = polled {
                    assert_eq!(sweep.samples.len(), 768, "no position was late");
                    let reading = extractor.extract(&sweep).expect("it is received");
                    return reading.bearing.expect("it has a direction").angle;
                }
            }
            panic!("the turn does not end");
        })
        .collect()
}

/// The bearings of the direct simulation, and of the same world through the wire.
fn both(channel: ChannelConfig) -> (Vec<f64>, Vec<f64>) {
    let stepper = StepperConfig::pritzl2018().with_timeouts(1.0, 10.0).expect("they are positive");
    let direct = world(channel.clone());
    let mut source = direct.stepper(0, stepper).expect("there is a drone");
    let expected = bearings(&direct, &mut source, || {});

    let through = world(channel);
    let (here, there) = memory_pair();
    let emulated = EmulatedStepperConfig::default();
    let mut device = EmulatedStepper::new(&through, 0, emulated, there).expect("it is in order");
    let motor = FirmataStepper::new(FirmataConfig::default(), here, through.clock());
    let motor = motor.expect("it is in order");
    let radio = through.radio(0).expect("there is a drone");
    let vehicle = through.vehicle(0).expect("there is a drone");
    let mut source = StepperSource::new(stepper, radio, motor, vehicle, through.clock());
    let received = bearings(&through, &mut source, || device.serve().expect("it holds"));
    (expected, received)
}

#[test]
fn a_turn_has_the_bearings_of_the_direct_simulation() {
    let quiet = ChannelConfig {
        sample_sigma_db: 0.0,
        pattern_sigma_db: 0.0,
        bearing_sigma_deg: 0.0,
        ..ChannelConfig::default()
    };
    let (expected, received) = both(quiet);
    for (received, expected) in received.iter().zip(&expected) {
        // Half a half step of the motor, and readings that are rounded to whole dB.
        let error = angle::distance(*received, *expected);
        assert!(error < 0.005, "{received:?}, not {expected:?}");
    }
}

#[test]
fn patterns_begin_with_the_same_turns() {
    // What is drawn for each pattern shows where it begins.
    let drawn = ChannelConfig { sample_sigma_db: 0.0, ..ChannelConfig::default() };
    let (expected, received) = both(drawn);
    for (received, expected) in received.iter().zip(&expected) {
        // One of 128 positions has the last pattern's samples: the emulated antenna gets no
        // message when a turn begins, and notices it when it goes back.
        let error = angle::distance(*received, *expected);
        assert!(error < 0.1, "{received:?}, not {expected:?}");
    }
    assert!(angle::distance(expected[0], expected[1]) > 0.15, "the turns differ: {expected:?}");
}
