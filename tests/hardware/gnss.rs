//! GNSS drivers against an emulated receiver on a simulated drone.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use std::{cell::RefCell, collections::VecDeque, io, rc::Rc};

use foxhunt::{
    filters::Ukf,
    geodesy::LocalFrame,
    hardware::{
        CarriedConfig, CarriedVehicle, Corrections, CorrectionsConfig, Finding, FixQuality,
        GnssConfig, GnssDecoder, GnssError, GnssKind, GnssReceiver, Placed, Positioning,
    },
    prelude::*,
    sensors::{
        LogDistance, MaximumLikelihood, PatternTable, RssBearing, StepperConfig, StepperSource,
    },
    sim::{
        BeaconConfig, CableFaults, Cabled, ChannelConfig, DroneConfig, EmulatedCaster,
        EmulatedCasterConfig, EmulatedGnss, EmulatedGnssConfig, EmulatedGnssKind, Emulator,
        Interval, SimClock, World, WorldConfig,
    },
    wire::{ByteStream, MemoryStream, memory_pair, rtcm},
};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use statrs::distribution::{ChiSquared, ContinuousCDF};

const KINDS: [(EmulatedGnssKind, GnssKind); 3] = [
    (EmulatedGnssKind::Nmea, GnssKind::Nmea),
    (EmulatedGnssKind::Ublox, GnssKind::Ublox),
    (EmulatedGnssKind::Gpsd, GnssKind::Gpsd),
];

/// One drone 30 m up at (40, −25) m, and a beacon.
fn world() -> World {
    let beacon = BeaconConfig { name: "fox".into(), east_m: 60.0, ..BeaconConfig::default() };
    let drone = DroneConfig { east_m: 40.0, north_m: -25.0, up_m: 30.0, ..DroneConfig::default() };
    // The radio's noise is small, so that it does not hide that of the place.
    let channel = ChannelConfig {
        pattern_sigma_db: 0.0,
        sample_sigma_db: 1.0,
        bearing_sigma_deg: 0.0,
        ..ChannelConfig::default()
    };
    let beacons = vec![beacon];
    let drones = vec![drone];
    let config = WorldConfig { beacons, drones, channel, ..WorldConfig::default() };
    World::new(&config, 7).expect("a proper world")
}

fn frame() -> LocalFrame {
    LocalFrame::new(EmulatedGnssConfig::default().origin).expect("on Earth")
}

type Receiver<S = MemoryStream> = GnssReceiver<S, SimClock, Box<dyn GnssDecoder>>;

/// An emulated receiver and what reads it, over memory.
fn pair(
    world: &World,
    kind: usize,
    emulated: EmulatedGnssConfig,
) -> (EmulatedGnss<MemoryStream>, Receiver) {
    let (near, far) = memory_pair();
    let (far_kind, near_kind) = KINDS[kind];
    let emulated = EmulatedGnssConfig { kind: far_kind, ..emulated };
    let emulator = EmulatedGnss::new(world, 0, emulated, 3, far).expect("a proper receiver");
    let config = GnssConfig { kind: near_kind, ..GnssConfig::default() };
    (emulator, GnssReceiver::new(config, near, world.clock()).expect("in range"))
}

/// Lets time pass for the emulator and the driver.
fn run<S: ByteStream, T: ByteStream>(
    world: &World,
    emulator: &mut EmulatedGnss<S>,
    receiver: &mut Receiver<T>,
    seconds: f64,
) {
    let end = world.time() + seconds;
    while world.time() < end - 1e-9 {
        world.advance(0.1).expect("a step");
        emulator.serve().expect("memory");
        receiver.poll().expect("memory");
    }
}

#[test]
fn every_kind_reports_every_quality_where_the_drone_is() {
    use FixQuality::{Autonomous, Differential, Estimated, RtkFixed, RtkFloat};
    for kind in 0..3 {
        for quality in [Estimated, Autonomous, Differential, RtkFloat, RtkFixed] {
            let world = world();
            let emulated = EmulatedGnssConfig::default().with_quality(quality);
            let sigma = emulated.sigma_m;
            let (mut emulator, mut receiver) = pair(&world, kind, emulated);
            run(&world, &mut emulator, &mut receiver, 3.0);
            let position = receiver.position().expect("a fix");
            assert_eq!(position.quality, quality, "{kind}");
            let error =
                frame().to_local(&position.place) - world.pose(0).expect("there is one").position;
            // Five sigma, and the last digit of UBX: 1.1 cm.
            let bound = 5.0 * sigma + Vector3::repeat(0.012);
            assert!(
                error.abs().iter().zip(&bound).all(|(e, b)| e < b),
                "{kind} {quality:?}: {error}"
            );
            let last = receiver.last().expect("it spoke");
            assert_eq!(last.satellites, Some(14));
            let reported = last.sigma_m.expect("each of them reports it");
            assert!((reported - sigma).norm() < 2e-3, "{kind} {quality:?}: {reported}");
            let utc = last.utc_s.expect("dated");
            assert!(abs_diff_eq!(utc, 1_767_225_603.0, epsilon = 0.011), "{kind}: {utc}");
        }
    }
}

/// Normalised errors squared of independent fixes are chi-squared: one false alarm in a thousand
/// runs of each kind, for the seed 3.
#[test]
fn the_reported_sigma_is_honest() {
    const SAMPLES: u32 = 400;
    let chi = ChiSquared::new(f64::from(3 * SAMPLES)).expect("positive");
    let band = chi.inverse_cdf(0.0005)..chi.inverse_cdf(0.9995);
    for kind in 0..3 {
        let world = world();
        // The correlation after 8 s is exp(−8).
        let emulated = EmulatedGnssConfig { correlation_s: 1.0, ..EmulatedGnssConfig::default() };
        let (mut emulator, mut receiver) = pair(&world, kind, emulated);
        let truth = world.pose(0).expect("there is one").position;
        let mut sum = 0.0;
        for _ in 0..SAMPLES {
            run(&world, &mut emulator, &mut receiver, 8.0);
            let last = receiver.last().expect("it spoke");
            let error = frame().to_local(&last.place.expect("a fix")) - truth;
            sum += error.component_div(&last.sigma_m.expect("reported")).norm_squared();
        }
        assert!(band.contains(&sum), "{kind}: {sum} is not within {band:?}");
    }
}

/// Errors do wander: correlated from fix to fix by their time constant.
#[test]
fn errors_are_correlated_in_time() {
    let world = world();
    let emulated = EmulatedGnssConfig { correlation_s: 10.0, ..EmulatedGnssConfig::default() };
    let (mut emulator, mut receiver) = pair(&world, 0, emulated);
    let truth = world.pose(0).expect("there is one").position;
    let mut errors = Vec::new();
    for _ in 0..2000 {
        run(&world, &mut emulator, &mut receiver, 1.0);
        let place = receiver.last().and_then(|fix| fix.place).expect("a fix");
        errors.push((frame().to_local(&place) - truth).x);
    }
    let lagged = |lag: usize| {
        let products: f64 = errors.iter().zip(&errors[lag..]).map(|(a, b)| a * b).sum();
        products / errors.iter().map(|e| e * e).sum::<f64>()
    };
    // Of 200 time constants: within three times √(2 τ / T) of exp(−0.1) and exp(−5).
    assert_abs_diff_eq!(lagged(1), 0.905, epsilon = 0.05);
    assert_abs_diff_eq!(lagged(50), 0.0, epsilon = 0.3);
}

#[test]
fn an_outage_inflates_sigma_then_is_an_error_and_passes() {
    for kind in 0..3 {
        let world = world();
        let outages = vec![Interval { from_s: 10.0, to_s: Some(20.0) }];
        let emulated = EmulatedGnssConfig { outages, ..EmulatedGnssConfig::default() };
        let (mut emulator, mut receiver) = pair(&world, kind, emulated);
        run(&world, &mut emulator, &mut receiver, 9.8);
        let mut before = receiver.position().expect("a fix").sigma_m.x;
        for _ in 0..4 {
            run(&world, &mut emulator, &mut receiver, 1.0);
            let now = receiver.position().expect("not too old yet").sigma_m.x;
            assert!(now > before + 0.3, "{kind}: from {before} m to {now} m");
            before = now;
        }
        run(&world, &mut emulator, &mut receiver, 2.0);
        assert!(matches!(receiver.position(), Err(GnssError::Stale { .. })), "{kind}");
        assert_eq!(receiver.last().map(|fix| fix.quality), Some(FixQuality::None));
        run(&world, &mut emulator, &mut receiver, 6.0);
        assert!(receiver.position().is_ok(), "{kind}: it is back");
    }
}

#[test]
fn a_receiver_that_was_reset_is_set_up_again() {
    let world = world();
    let (near, mut far) = memory_pair();
    let emulated =
        EmulatedGnssConfig { kind: EmulatedGnssKind::Ublox, ..EmulatedGnssConfig::default() };
    let config = GnssConfig { kind: GnssKind::Ublox, ..GnssConfig::default() };
    let mut receiver = GnssReceiver::new(config, near, world.clock()).expect("in range");
    for seed in 1..=2 {
        // The second one has forgotten that NAV-PVT was turned on.
        let mut emulator =
            EmulatedGnss::new(&world, 0, emulated.clone(), seed, &mut far).expect("proper");
        run(&world, &mut emulator, &mut receiver, 5.0);
        let age = receiver.position().expect("a fix").age_s;
        assert!(age < 0.5, "receiver {seed}: {age} s old");
    }
}

/// A line that loses, cuts and adds bytes.
struct Noisy<S> {
    stream: S,
    kept: VecDeque<u8>,
    chance: Xoshiro256PlusPlus,
}

impl<S: ByteStream> ByteStream for Noisy<S> {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let mut piece = [0; 64];
        let count = self.stream.receive(&mut piece)?;
        let drawn: f64 = self.chance.random();
        if drawn < 0.15 {
            let length = self.chance.random_range(1..40);
            self.kept.extend((0..length).map(|_| self.chance.random::<u8>()));
        }
        let lost = if drawn > 0.93 { self.chance.random_range(0..=count) } else { 0 };
        self.kept.extend(&piece[lost..count]);
        let given = self.kept.len().min(into.len());
        for (to, from) in into.iter_mut().zip(self.kept.drain(..given)) {
            *to = from;
        }
        Ok(given)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.send(bytes)
    }
}

#[test]
fn garbage_and_cut_messages_cost_fixes_and_nothing_else() {
    for (kind, (far_kind, near_kind)) in KINDS.into_iter().enumerate() {
        let world = world();
        let (near, far) = memory_pair();
        let emulated = EmulatedGnssConfig { kind: far_kind, ..EmulatedGnssConfig::default() };
        let mut emulator = EmulatedGnss::new(&world, 0, emulated, 3, far).expect("proper");
        let chance = Xoshiro256PlusPlus::seed_from_u64(11);
        let line = Noisy { stream: near, kept: VecDeque::new(), chance };
        let config = GnssConfig { kind: near_kind, ..GnssConfig::default() };
        let mut receiver = GnssReceiver::new(config, line, world.clock()).expect("in range");
        let truth = world.pose(0).expect("there is one").position;
        let mut fresh = 0;
        let mut wrong = 0;
        for _ in 0..600 {
            run(&world, &mut emulator, &mut receiver, 0.2);
            let Ok(position) = receiver.position() else { continue };
            fresh += i32::from(position.age_s < 0.1);
            let error = frame().to_local(&position.place) - truth;
            wrong += i32::from(error.norm() > 20.0);
        }
        // An epoch of gpsd is eight pieces long, each of which is spoiled with a chance of 0.22.
        let wanted = if kind == 2 { 150 } else { 300 };
        assert!(fresh > wanted, "{kind}: {fresh} fresh fixes of 600");
        // JSON has no checksum: it comes over TCP, which keeps such damage from it.
        assert!(wrong == 0 || kind == 2, "{kind}: {wrong}");
        assert!(receiver.decoder().refused() > 0, "{kind}: the line was damaged");
    }
}

/// Reception of one turn of an antenna whose place comes from this receiver, and a filter's
/// estimate from it.
fn received(quality: FixQuality) -> (Reception, Estimate<2>) {
    let world = world();
    let (near, far) = memory_pair();
    let emulated = EmulatedGnssConfig {
        kind: EmulatedGnssKind::Ublox,
        ..EmulatedGnssConfig::default().with_quality(quality)
    };
    let mut emulator = EmulatedGnss::new(&world, 0, emulated, 3, far).expect("proper");
    // As on a tripod: a fix holds until the next one.
    let config = GnssConfig { kind: GnssKind::Ublox, speed_mps: 0.0, ..GnssConfig::default() };
    let mut receiver = GnssReceiver::new(config, near, world.clock()).expect("in range");
    run(&world, &mut emulator, &mut receiver, 2.0);
    let vehicle = world.vehicle(0).expect("there is one");
    let placed = Placed::new(vehicle, receiver, frame(), config.antenna());
    let radio = world.radio(0).expect("one");
    let rotator = world.rotator(0).expect("one");
    let stepper = StepperConfig::pritzl2018();
    let mut source = StepperSource::new(stepper, radio, rotator, placed, world.clock());
    source.begin(&[BeaconId(0)]).expect("simulated");
    let extractor = MaximumLikelihood::new(PatternTable::reference_patch());
    let reception = loop {
        world.advance(0.02).expect("a step");
        emulator.serve().expect("memory");
        if let Some(sweep) = source.poll().expect("a fix at every moment") {
            break Reception::new(&sweep, &extractor.extract(&sweep).expect("it was received"));
        }
    };
    let prior = Estimate::isotropic(nalgebra::Vector2::new(55.0, 5.0), 10.0);
    let law = LogDistance::new(-29.06, 2.765).expect("in range");
    let mut filter =
        Ukf::new(RandomWalk::uniform(0.0), RssBearing::new(law), prior).expect("a proper prior");
    let intake = ByQuantity([Quantity::RSS, Quantity::BEARING]);
    let observation = intake.observation(&reception).expect("a proper reception");
    let observation = observation.expect("it has a level");
    assert!(!filter.update(&observation).expect("it can be fused").is_rejected());
    (reception, filter.estimate())
}

fn level(reception: &Reception) -> f64 {
    reception.level.expect("the radio measures it").rss_dbm
}

#[test]
fn a_poor_fix_makes_an_estimator_learn_less() {
    let (rtk, precise) = received(FixQuality::RtkFixed);
    let (alone, vague) = received(FixQuality::Estimated);
    let sigma = |reception: &Reception| reception.receiver_sigma_m.expect("it was reported");
    assert!((sigma(&rtk) - Vector3::new(0.012, 0.012, 0.02)).norm() < 2e-3, "{}", sigma(&rtk));
    // The floor of dead reckoning is above what the receiver claims.
    assert_eq!(sigma(&alone), Vector3::new(10.0, 10.0, 20.0));
    let area = |estimate: &Estimate<2>| estimate.covariance.determinant();
    assert!(area(&vague) > 2.0 * area(&precise), "{} and {}", area(&vague), area(&precise));
    // The same noise of the radio: without the σ there would be next to no difference.
    assert_abs_diff_eq!(level(&rtk), level(&alone), epsilon = 1e-9);
}

#[test]
fn a_walker_is_a_vehicle() {
    let world = world();
    let (mut emulator, mut receiver) =
        pair(&world, 2, EmulatedGnssConfig::default().with_quality(FixQuality::RtkFixed));
    run(&world, &mut emulator, &mut receiver, 1.0);
    let config = CarriedConfig { up_m: 30.0, ..CarriedConfig::default() };
    let mut walker = CarriedVehicle::new(config, receiver, frame());
    walker.set_heading(0.5);
    let pose = walker.pose().expect("a fix");
    assert!((pose.position - world.pose(0).expect("one").position).norm() < 0.1);
    assert_abs_diff_eq!(pose.heading, 0.5, epsilon = 1e-12);
    let goal = Waypoint { position: Vector3::new(1.0, 2.0, 0.0) };
    walker.go_to(&goal).expect("kept for the person");
    assert_eq!(walker.goal(), Some(goal));
    assert!(walker.position_sigma().is_some_and(|sigma| sigma.x < 1.0));
}

/// Findings about a receiver: `emulated` behind a driver of another or the same kind.
fn examined(emulated: EmulatedGnssConfig, kind: GnssKind) -> String {
    let world = world();
    let (near, far) = memory_pair();
    let emulator = EmulatedGnss::new(&world, 0, emulated, 3, far).expect("proper");
    let emulator = Rc::new(RefCell::new(emulator));
    let config = GnssConfig { kind, ..GnssConfig::default() };
    let mut receiver = GnssReceiver::new(config, near, world.clock()).expect("in range");
    let findings = receiver.examine(&mut || {
        world.advance(0.05).expect("a step");
        emulator.borrow_mut().serve().expect("memory");
    });
    assert!(world.time() < 11.0, "it is patient for ten seconds");
    findings.iter().map(|finding| format!("{finding}\n")).collect()
}

#[test]
fn what_is_wrong_is_found_with_its_remedy() {
    let emulated = EmulatedGnssConfig::default;
    let good = examined(emulated(), GnssKind::Nmea);
    for part in
        ["receiver: NMEA", "fix: autonomous, 14 satellites, HDOP 0.8", "σ East 1.50", "age: 0"]
    {
        assert!(good.contains(part), "{part} in {good}");
    }
    assert!(!good.contains('('), "nothing is wrong: {good}");
    let wrong = examined(emulated(), GnssKind::Gpsd);
    assert!(wrong.contains("none of them are gpsd") && wrong.contains("the kind"), "{wrong}");
    let silent =
        examined(EmulatedGnssConfig { kind: EmulatedGnssKind::Gpsd, ..emulated() }, GnssKind::Nmea);
    assert!(silent.contains("none of them are NMEA"), "gpsd greets: {silent}");
    let outages = vec![Interval::default()];
    let blind = examined(EmulatedGnssConfig { outages, ..emulated() }, GnssKind::Nmea);
    assert!(blind.contains("fix: none, 2 satellites") && blind.contains("free sky"), "{blind}");
    let poor = EmulatedGnssConfig { sigma_m: Vector3::new(9.0, 9.0, 9.0), ..emulated() };
    let poor = examined(poor, GnssKind::Nmea);
    assert!(poor.contains("σ East 9.00") && poor.contains("away from walls"), "{poor}");
}

#[test]
fn an_impossible_emulated_receiver_is_refused_by_name() {
    let refused = |drone, config| {
        let (_near, far) = memory_pair();
        EmulatedGnss::new(&world(), drone, config, 1, far).expect_err("impossible").to_string()
    };
    let reported = refused(0, EmulatedGnssConfig { rate_hz: 0.0, ..EmulatedGnssConfig::default() });
    assert_eq!(reported, "gnss.rate_hz is 0; it must be from 0.1 to 25");
    let mut config = EmulatedGnssConfig::default();
    config.origin.lat_deg = 91.0;
    assert!(refused(0, config).contains("gnss.origin.lat_deg is 91"));
    assert!(refused(1, EmulatedGnssConfig::default()).contains("no drone 1"));
}

/// A caster, an emulated receiver that needs its corrections, and the driver between them.
struct Chain {
    world: World,
    caster: EmulatedCaster<Cabled<MemoryStream>>,
    emulator: EmulatedGnss<MemoryStream>,
    receiver: Receiver,
}

impl Chain {
    /// With a client of these settings; the cable of the caster has these faults.
    fn new(kind: usize, client: CorrectionsConfig, faults: CableFaults) -> Self {
        let world = world();
        let emulated = EmulatedGnssConfig {
            corrections_s: Some(10.0),
            ..EmulatedGnssConfig::default().with_quality(FixQuality::RtkFixed)
        };
        let (emulator, receiver) = pair(&world, kind, emulated);
        let (near, far) = memory_pair();
        let far = Cabled::new(far, world.clock(), faults, 5);
        let credentials = Some(("hunter".to_owned(), "tally-ho".to_owned()));
        let config = EmulatedCasterConfig { credentials, ..EmulatedCasterConfig::default() };
        let caster = EmulatedCaster::new(&world, config, far).expect("a proper caster");
        let corrections = Corrections::new(client, KINDS[kind].1, Box::new(near));
        let receiver = receiver.with_corrections(corrections.expect("proper settings"));
        Self { world, caster, emulator, receiver }
    }

    fn run(&mut self, seconds: f64) {
        let end = self.world.time() + seconds;
        while self.world.time() < end - 1e-9 {
            self.world.advance(0.1).expect("a step");
            self.caster.serve().expect("memory");
            self.emulator.serve().expect("memory");
            self.receiver.poll().expect("memory");
        }
    }

    fn quality(&mut self) -> FixQuality {
        self.receiver.position().expect("a fix").quality
    }

    /// The loss that begins now, if one does, as a flight's log has it.
    fn failure(&mut self) -> Option<String> {
        self.receiver.failure().map(|failure| failure.to_string())
    }

    fn corrections(&self) -> &Corrections {
        self.receiver.corrections().expect("given")
    }

    fn finding(&mut self) -> Finding {
        let Self { world, caster, emulator, receiver } = self;
        let findings = receiver.examine(&mut || {
            world.advance(0.1).expect("a step");
            caster.serve().expect("memory");
            emulator.serve().expect("memory");
        });
        let own = findings.into_iter().find(|finding| finding.subject == "corrections");
        own.expect("there are corrections")
    }
}

/// Settings of a client that the caster serves, with the password in a file of its own.
fn client(name: &str, password: &str) -> CorrectionsConfig {
    let file = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("password-{name}"));
    std::fs::write(&file, format!("{password}\n")).expect("a folder for tests");
    CorrectionsConfig {
        endpoint: Some("tcp:caster.example:2101".parse().expect("an endpoint")),
        mountpoint: Some("FOX".into()),
        user: Some("hunter".into()),
        password_file: Some(file),
        ..CorrectionsConfig::default()
    }
}

#[test]
fn rtk_is_reached_only_while_corrections_come() {
    for (kind, ntrip) in [(0, 1), (0, 2), (1, 1), (1, 2)] {
        let own = client(&format!("rtk-{kind}-{ntrip}"), "tally-ho");
        let own = CorrectionsConfig { ntrip: Some(ntrip), gga_s: Some(5.0), ..own };
        let pulled = vec![Interval { from_s: 20.0, to_s: Some(38.0) }];
        let faults = CableFaults { pulled, ..CableFaults::default() };
        let mut chain = Chain::new(kind, own, faults);
        chain.run(10.0);
        assert_eq!(chain.quality(), FixQuality::RtkFixed, "{kind} {ntrip}");
        assert_eq!(chain.failure(), None);
        let frames = chain.corrections().frames();
        assert!((18..=22).contains(&frames), "{frames} of two a second");
        let (lat_deg, lon_deg) = chain.caster.rover().expect("a place was sent");
        assert_abs_diff_eq!(lat_deg, 50.1, epsilon = 1e-3);
        assert_abs_diff_eq!(lon_deg, 14.5, epsilon = 1e-3);
        let finding = chain.finding();
        assert!(finding.is_good(), "{finding}");
        for part in ["FOX at tcp:caster.example:2101", "1005, 1230", " 0 damaged", " s old"] {
            assert!(finding.text.contains(part), "{part}: {finding}");
        }
        // The link breaks at 20 s: the receiver is left alone after 10 s, and this is known once.
        chain.run(22.0);
        assert_eq!(chain.quality(), FixQuality::Autonomous, "{kind} {ntrip}");
        let lost = chain.failure().expect("the corrections have stopped");
        assert!(
            lost.contains("has no corrections from FOX at tcp:caster.example:2101 for 1"),
            "{lost}"
        );
        assert_eq!(chain.failure(), None, "once");
        let finding = chain.finding();
        assert!(!finding.is_good() && finding.text.contains("no corrections"), "{finding}");
        chain.run(20.0);
        assert_eq!(chain.quality(), FixQuality::RtkFixed, "it is back: {kind} {ntrip}");
        assert_eq!(chain.failure(), None);
        assert!(chain.finding().is_good());
    }
}

#[test]
fn a_caster_refuses_in_words() {
    let wrong = client("wrong", "yoicks");
    let nobody = CorrectionsConfig { user: None, password_file: None, ..wrong.clone() };
    let mountpoint = Some("HOUND".to_owned());
    let elsewhere = CorrectionsConfig { mountpoint, ..client("elsewhere", "tally-ho") };
    for (own, reason) in [
        (wrong, "refuses the user or the password: check user"),
        (nobody, "wants a user and a password: set user"),
        (elsewhere, "has no such mountpoint: take a name from its source table"),
    ] {
        for ntrip in [1, 2] {
            let own = CorrectionsConfig { ntrip: Some(ntrip), ..own.clone() };
            let mut chain = Chain::new(0, own, CableFaults::default());
            chain.run(1.0);
            let finding = chain.finding();
            assert!(!finding.is_good() && finding.text.contains(reason), "{ntrip}: {finding}");
            chain.run(11.0);
            let lost = chain.failure().expect("none has come");
            assert!(lost.contains(reason) && !lost.contains("yoicks"), "{ntrip}: {lost}");
            assert_eq!(chain.quality(), FixQuality::Autonomous);
            assert!(!format!("{:?}", chain.corrections()).contains("yoicks"));
        }
    }
}

#[test]
fn damaged_frames_are_not_forwarded() {
    let (near, mut far) = memory_pair();
    let world = world();
    let endpoint = Some("serial:/dev/ttyUSB0:57600".parse().expect("an endpoint"));
    let own = CorrectionsConfig { endpoint, ..CorrectionsConfig::default() };
    let corrections = Corrections::new(own, GnssKind::Nmea, Box::new(near)).expect("proper");
    let (port, mut device) = memory_pair();
    let receiver: Receiver =
        GnssReceiver::new(GnssConfig::default(), port, world.clock()).expect("in range");
    let mut receiver = receiver.with_corrections(corrections);
    let whole = rtcm::frame(&[0x3e, 0xd7, 0xd3, 1, 2, 3]).expect("short");
    let mut damaged = whole.clone();
    damaged[5] ^= 0x10;
    for bytes in [&whole, &damaged, &whole] {
        far.send(bytes).expect("memory");
    }
    receiver.poll().expect("memory");
    let mut forwarded = [0; 512];
    let mut count = 0;
    while let Ok(more @ 1..) = device.receive(&mut forwarded[count..]) {
        count += more;
    }
    assert_eq!(forwarded[..count], [&whole[..], &whole].concat());
    let counted = receiver.corrections().expect("given");
    assert_eq!((counted.frames(), counted.damaged()), (2, 1));
}

#[test]
fn a_file_is_followed_from_its_end() {
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("corrections.rtcm");
    let whole = rtcm::frame(&[0x3e, 0xd7, 0xd3]).expect("short");
    std::fs::write(&path, &whole).expect("a folder for tests");
    let own = CorrectionsConfig { file: Some(path.clone()), ..CorrectionsConfig::default() };
    let corrections = Corrections::follow(own.clone(), GnssKind::Ublox).expect("it is there");
    let world = world();
    let (_emulator, mut receiver) = pair(&world, 1, EmulatedGnssConfig::default());
    receiver = receiver.with_corrections(corrections);
    let frames = |receiver: &mut Receiver| {
        receiver.poll().expect("memory");
        receiver.corrections().expect("given").frames()
    };
    assert_eq!(frames(&mut receiver), 0, "what was there is old");
    let mut file = std::fs::OpenOptions::new().append(true).open(&path).expect("it is there");
    std::io::Write::write_all(&mut file, &whole).expect("appended");
    assert_eq!(frames(&mut receiver), 1);
    std::fs::remove_file(&path).expect("it was there");
    let missing = Corrections::follow(own, GnssKind::Ublox).expect_err("it is gone").to_string();
    assert!(missing.contains(&path.display().to_string()), "{missing}");
}
