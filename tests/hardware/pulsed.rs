//! Tags that pulse, through an RTL-SDR behind rtl_tcp: levels, and nothing without a tag.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use foxhunt::{
    core::{BeaconId, Radio},
    fly::{EmulatedField, EmulatedFieldConfig, FlightConfig, Mission},
    hardware::{PulseConfig, RtlTcpConfig, RtlTcpRadio},
    hunt::{BoxedSource, Event},
    registry::Registry,
    scenario::Scenario,
    sensors::{AntennaConfig, LogDistance},
    sim::{
        BeaconConfig, ChannelConfig, DroneConfig, EmulatedRtlTcp, EmulatedRtlTcpConfig, Emulator,
        InterfererConfig, PathLossConfig, PlayedPulse, PulseTrain, SimClock, World, WorldConfig,
    },
    wire::{MemoryStream, memory_pair},
};

const TAG_HZ: u32 = 150_100_000;

/// Pulses of a tag, and their strength.
#[derive(Clone, Copy)]
struct Tag {
    level_dbm: f64,
    off_hz: f64,
    appears_after_s: Option<f64>,
}

const STRONG: Tag = Tag { level_dbm: -16.1, off_hz: 0.0, appears_after_s: None };

/// A receiver with so much noise that its quantile of 0.9 over 5 kHz is −34 dB of full scale, and
/// tags of 20 ms each 1.3 s.
struct Bench {
    world: World,
    server: EmulatedRtlTcp<MemoryStream>,
    radio: RtlTcpRadio<MemoryStream, SimClock>,
    played: Vec<PlayedPulse>,
}

fn world(tags: &[Tag]) -> World {
    let train = PulseTrain { pulse_s: 0.02, interval_s: 1.3, jitter_s: 0.005, phase_s: 0.4 };
    let beacons = tags.iter().zip(0..).map(|(tag, place)| BeaconConfig {
        // Ten metres of a path loss of 20 dB.
        north_m: 10.0,
        appears_after_s: tag.appears_after_s,
        frequency_mhz: Some((f64::from(TAG_HZ + 50_000 * place) + tag.off_hz) / 1e6),
        pulses: Some(PulseTrain { phase_s: 0.4 + 0.31 * f64::from(place), ..train }),
        ..BeaconConfig::default()
    });
    let law = LogDistance::new(tags[0].level_dbm + 20.0, 2.0).expect("a law");
    let channel = ChannelConfig {
        path_loss: PathLossConfig::LogDistance(law),
        antenna: AntennaConfig::Isotropic,
        pattern_sigma_db: 0.0,
        sample_sigma_db: 0.0,
        bearing_sigma_deg: 0.0,
        ..ChannelConfig::default()
    };
    let config = WorldConfig {
        beacons: beacons.collect(),
        drones: vec![DroneConfig::default()],
        channel,
        ..WorldConfig::default()
    };
    World::new(&config, 3).expect("a world")
}

impl Bench {
    fn new(tags: &[Tag], change: impl FnOnce(&mut RtlTcpConfig)) -> Self {
        let world = world(tags);
        let (device, host) = memory_pair();
        let noisy = EmulatedRtlTcpConfig { noise_steps: 8.0, ..EmulatedRtlTcpConfig::default() };
        let server = EmulatedRtlTcp::new(&world, 0, noisy, device).expect("it is in order");
        let frequencies = (0..).map(|place| TAG_HZ + 50_000 * place).take(tags.len());
        let mut config = RtlTcpConfig {
            frequencies_hz: frequencies.collect(),
            sample_rate_hz: 250_000,
            beside_hz: 20_000,
            gain_db: 0.0,
            settling_s: 0.02,
            full_scale_dbm: 0.0,
            pulse: Some(PulseConfig::new(0.02, 1.3)),
            ..RtlTcpConfig::default()
        };
        change(&mut config);
        let radio = RtlTcpRadio::new(config, host, world.clock()).expect("it is in order");
        Self { world, server, radio, played: Vec::new() }
    }

    /// Lets 10 ms pass.
    fn pass(&mut self) {
        self.world.advance(0.01).expect("time passes");
        self.server.serve().expect("it is in memory");
        self.played.extend(self.server.played());
    }

    /// Reception within this number of seconds of a question: the level, and when it was measured.
    fn query(&mut self, beacon: u16, seconds: u32) -> Option<(f64, f64)> {
        self.radio.request(BeaconId(beacon)).expect("it is connected");
        for _ in 0..100 * seconds {
            self.pass();
            if let Some(level) = self.radio.poll().expect("it is connected") {
                return Some((level, self.radio.measured_at().expect("a pulse has a time")));
            }
        }
        None
    }
}

/// Each answer is the level of a pulse that was played after the question, at the pulse's time.
fn assert_levels(bench: &mut Bench, questions: usize, within_db: f64) {
    for _ in 0..questions {
        let requested = bench.world.time();
        let (level, time) = bench.query(0, 4).expect("each question meets a pulse");
        let near = |pulse: &&PlayedPulse| (pulse.time_s - time).abs() < 0.01;
        let pulse = bench.played.iter().find(near).expect("a pulse was there");
        assert!(pulse.time_s > requested, "a pulse of {} at {requested}", pulse.time_s);
        let off = level - pulse.power_dbm;
        assert!(abs_diff_eq!(off, 0.0, epsilon = within_db), "{level} dBm for {}", pulse.power_dbm);
    }
}

#[test]
fn a_strong_tag_has_its_level() {
    let mut bench = Bench::new(&[STRONG], |_| {});
    assert_levels(&mut bench, 6, 0.5);
    assert_abs_diff_eq!(bench.played[0].power_dbm, -16.1, epsilon = 0.01);
    // Each pulse once: the first waits until the noise is known, the others an interval.
    assert!(bench.world.time() < 3.0 + 6.0 * 1.4, "{}", bench.world.time());
}

#[test]
fn a_tag_four_kilohertz_off_has_its_level() {
    let mut bench = Bench::new(&[Tag { off_hz: 4000.0, ..STRONG }], |_| {});
    assert_levels(&mut bench, 4, 0.5);
}

#[test]
fn no_tag_is_no_level() {
    let mut bench = Bench::new(&[Tag { appears_after_s: Some(1e6), ..STRONG }], |_| {});
    for _ in 0..5 {
        assert_eq!(bench.query(0, 4), None);
    }
    let findings = bench.radio.examine(&mut || {
        bench.world.advance(0.01).expect("time passes");
        bench.server.serve().expect("it is in memory");
    });
    assert!(findings[1].to_string().contains("no pulse"), "{findings:?}");
}

#[test]
fn a_weak_tag_has_its_level_or_none() {
    // Noise of 8 steps is −75.1 dB of full scale in a hertz.
    let level_dbm = -75.1 + 17.0 + 17.0;
    let mut bench = Bench::new(&[Tag { level_dbm, ..STRONG }], |_| {});
    let levels: Vec<f64> = (0..12).filter_map(|_| Some(bench.query(0, 4)?.0)).collect();
    assert!(levels.len() >= 10, "{levels:?}");
    let count = u32::try_from(levels.len()).expect("a few");
    let mean = levels.iter().sum::<f64>() / f64::from(count);
    assert_abs_diff_eq!(mean, level_dbm, epsilon = 1.0);
    let floor = bench.radio.pulse_floor_dbm(BeaconId(0)).expect("the noise is known");
    // 13 to 14.5 dB of E/N0.
    assert!((-45.5..-43.0).contains(&floor), "{floor}");
    let mut far = Bench::new(&[Tag { level_dbm: level_dbm - 12.0, ..STRONG }], |_| {});
    for _ in 0..5 {
        assert_eq!(far.query(0, 4), None);
    }
}

#[test]
fn tags_beside_each_other_are_watched_together_and_apart() {
    let mut together = Bench::new(&[STRONG, STRONG], |_| {});
    // Too far apart for one band above its middle.
    let mut apart = Bench::new(&[STRONG, STRONG], |config| config.beside_hz = 90_000);
    for bench in [&mut together, &mut apart] {
        for beacon in [0, 1, 1, 0] {
            let (_, time) = bench.query(beacon, 5).expect("both are on air");
            let near = |pulse: &&PlayedPulse| (pulse.time_s - time).abs() < 0.01;
            let pulse = bench.played.iter().find(near).expect("a pulse was there");
            assert_eq!(pulse.beacon, BeaconId(beacon));
        }
    }
}

/// A hunt by three drones with RTL-SDRs and steppers, through all drivers, in simulated time: the
/// tag's pulses are found in the samples, and the drones find the tag.
#[test]
fn a_hunt_through_samples_finds_a_tag() {
    let mut scenario = Scenario::find("vhf-tag").expect("it is built in");
    scenario.hunt.stop.time_s = Some(90.0);
    let world = World::new(&scenario.world, 5).expect("a world");
    let rtl_tcp = EmulatedRtlTcpConfig {
        carrier_sigma_hz: 500.0,
        drift_hz_per_s: 1.0,
        oscillator_ppm: 5.0,
        interferers: vec![InterfererConfig {
            frequency_hz: 150.108e6,
            level_dbm: -70.0,
            on_s: None,
            every_s: None,
        }],
        ..EmulatedRtlTcpConfig::default()
    };
    let config = EmulatedFieldConfig { rtl_tcp, ..EmulatedFieldConfig::default() };
    let (mut field, mut ports) =
        EmulatedField::in_memory(&scenario, &world, &config).expect("devices");
    // As a user would have it: from a file.
    let text = toml::to_string(field.flight()).expect("it can be written");
    let flight = FlightConfig::parse(&text, "emulated.toml").expect("it can be read");
    let registry = Registry::builtin();
    let estimator = flight.estimator(&registry).expect("it is known");
    let hunt = flight.parts(&registry, estimator, 5).build().expect("a hunt");
    let drones = flight.open(&mut ports, &world.clock(), 0.0, None, None).expect("devices");
    let mut mission: Mission<_, BoxedSource> =
        Mission::new(flight.flight, hunt, drones, world.time()).expect("a flight");
    let mut receptions = 0;
    while !mission.is_over() && world.time() < 300.0 {
        world.advance(scenario.simulation.tick_s).expect("time passes");
        field.serve(|device, error| panic!("{device}: {error}"));
        mission.step(world.time());
        while let Some(event) = mission.poll_event() {
            receptions += usize::from(matches!(event, Event::Received { .. }));
        }
    }
    assert_eq!(mission.failure(), None);
    assert!(receptions >= 3, "{receptions}");
    let [fix] = mission.hunt().fixes() else { panic!("{:?}", mission.hunt().fixes()) };
    let tag = &scenario.world.beacons[0];
    let truth = nalgebra::Vector2::new(tag.east_m, tag.north_m);
    let error = (fix.estimate.mean - truth).norm();
    assert!(error < 8.0, "{error} m off at {}", fix.estimate.mean);
}
