//! The XBee driver against the emulated radio.

use std::{cell::Cell, io, rc::Rc};

use foxhunt::{
    core::{BeaconId, PatternSource, Radio},
    hardware::{XbeeConfig, XbeeError, XbeeQuestion, XbeeRadio},
    sensors::{StepperConfig, StepperSource},
    sim::{
        BeaconConfig, CableFaults, Cabled, ChannelConfig, DroneConfig, EmulatedXbee,
        EmulatedXbeeConfig, Emulator, Interval, SimClock, World, WorldConfig, xbee_address,
    },
    wire::{
        ByteStream, MemoryStream, memory_pair,
        xbee::{Address, ApiMode, Protocol},
    },
};

const FIRMWARES: [Protocol; 3] = [Protocol::Zigbee, Protocol::DigiMesh, Protocol::Ieee802154];

fn field(channel: ChannelConfig) -> WorldConfig {
    let beacon = |east_m, north_m, appears_after_s| BeaconConfig {
        east_m,
        north_m,
        appears_after_s,
        ..BeaconConfig::default()
    };
    WorldConfig {
        beacons: vec![
            beacon(20.0, 5.0, None),
            beacon(-9.0, 14.0, None),
            beacon(3.0, 3.0, Some(1e6)),
        ],
        drones: vec![DroneConfig { up_m: 4.0, ..DroneConfig::default() }],
        channel,
        ..WorldConfig::default()
    }
}

/// Whole dB, as radios report them.
fn noisy() -> ChannelConfig {
    ChannelConfig { whole_db: true, ..ChannelConfig::default() }
}

/// Channel with one level at every question.
fn quiet() -> ChannelConfig {
    ChannelConfig { pattern_sigma_db: 0.0, sample_sigma_db: 0.0, bearing_sigma_deg: 0.0, ..noisy() }
}

fn config(short: bool) -> XbeeConfig {
    let address = |beacon| {
        let (long, short_address) = xbee_address(BeaconId(beacon));
        if short { Address::Short(short_address) } else { Address::Long(long) }
    };
    XbeeConfig { beacons: (0..3).map(address).collect(), ..XbeeConfig::default() }
}

fn kind(firmware: Protocol, ap: u8) -> EmulatedXbeeConfig {
    EmulatedXbeeConfig { firmware, ap, ..EmulatedXbeeConfig::default() }
}

/// A world, the radio in it, and the driver that talks to it.
struct Bench<D, H> {
    world: World,
    device: EmulatedXbee<D>,
    radio: XbeeRadio<H, SimClock>,
}

impl<D: ByteStream, H: ByteStream> Bench<D, H> {
    fn new(world: World, kind: EmulatedXbeeConfig, config: XbeeConfig, device: D, host: H) -> Self {
        let device = EmulatedXbee::new(&world, 0, kind, device).expect("it is in order");
        let radio = XbeeRadio::new(config, host, world.clock()).expect("it is in order");
        Self { world, device, radio }
    }

    /// Lets a hundredth of a second pass; bytes take no time.
    fn tick(&mut self) -> Result<Option<f64>, XbeeError> {
        self.world.advance(0.01).expect("time passes");
        let mut reported = Ok(None);
        for _ in 0..8 {
            let _ = self.device.serve();
            match self.radio.poll() {
                Ok(None) => {}
                other => reported = other,
            }
        }
        reported
    }

    /// The level reported within a second of a question.
    fn query(&mut self, beacon: u16) -> Result<Option<f64>, XbeeError> {
        self.radio.request(BeaconId(beacon))?;
        for _ in 0..100 {
            if let Some(level) = self.tick()? {
                return Ok(Some(level));
            }
        }
        Ok(None)
    }
}

fn bench(
    channel: ChannelConfig,
    kind: EmulatedXbeeConfig,
    config: XbeeConfig,
) -> Bench<MemoryStream, MemoryStream> {
    let world = World::new(&field(channel), 3).expect("a world");
    let (device, host) = memory_pair();
    Bench::new(world, kind, config, device, host)
}

/// The world's own answers to the same questions.
fn direct(channel: ChannelConfig, questions: &[u16]) -> Vec<Option<f64>> {
    let world = World::new(&field(channel), 3).expect("a world");
    let mut radio = world.radio(0).expect("it exists");
    let mut query = |beacon| {
        radio.request(BeaconId(beacon)).expect("it exists");
        world.advance(0.1).expect("time passes");
        radio.poll().expect("it never fails")
    };
    questions.iter().map(|beacon| query(*beacon)).collect()
}

#[test]
fn levels_are_the_worlds_with_every_firmware_mode_and_question() {
    let questions = [0, 1, 0, 0, 1, 0, 1, 1];
    let expected = direct(noisy(), &questions);
    assert!(expected.iter().all(Option::is_some));
    let kinds = [XbeeQuestion::Auto, XbeeQuestion::TransmitDb, XbeeQuestion::RemoteDb];
    for firmware in FIRMWARES {
        for (ap, question, echoed, short) in
            [1, 2].iter().flat_map(|ap| kinds.map(|question| (*ap, question, *ap == 1, *ap == 2)))
        {
            let short = short && firmware != Protocol::DigiMesh;
            let config = XbeeConfig { question, echoed, ..config(short) };
            let mut bench = bench(noisy(), kind(firmware, ap), config);
            let reported: Vec<_> =
                questions.iter().map(|b| bench.query(*b).expect("nothing fails")).collect();
            assert_eq!(reported, expected, "{firmware} AP {ap} {question:?}");
            let identity = bench.radio.identity().expect("it is set up");
            assert_eq!(identity.protocol, firmware);
            assert_eq!(identity.mode == ApiMode::Escaped, ap == 2);
            assert_eq!(bench.radio.counts().answered, 8);
            assert_eq!(bench.radio.counts().foreign, 0);
        }
    }
}

#[test]
fn a_silent_beacon_costs_the_others_nothing() {
    for firmware in FIRMWARES {
        for question in [XbeeQuestion::Auto, XbeeQuestion::RemoteDb] {
            let config = XbeeConfig { question, ..config(false) };
            let mut bench = bench(quiet(), kind(firmware, 1), config);
            let level = bench.query(0).expect("nothing fails");
            assert!(level.is_some());
            assert_eq!(bench.query(2).expect("silence is no failure"), None);
            assert_eq!(bench.query(0).expect("nothing fails"), level);
            let counts = bench.radio.counts();
            assert_eq!((counts.queries, counts.answered), (3, 2), "{firmware}");
            assert_eq!((counts.silent, counts.undelivered), (1, 1), "{firmware}");
        }
    }
}

#[test]
fn garbage_and_cut_frames_are_survived() {
    for ap in [1, 2] {
        let world = World::new(&field(quiet()), 3).expect("a world");
        let (device, host) = memory_pair();
        let garbage = vec![Interval { from_s: 1.0, to_s: Some(60.0) }];
        let faults = CableFaults { garbage, ..CableFaults::default() };
        let device = Cabled::new(device, world.clock(), faults, 5);
        let expected = direct(quiet(), &[0])[0];
        let mut bench = Bench::new(world, kind(Protocol::Zigbee, ap), config(false), device, host);
        assert_eq!(bench.query(0).expect("nothing fails"), expected);
        let mut reported = 0;
        let mut requested = 0;
        while bench.world.time() < 60.0 {
            requested += 1;
            if let Some(level) = bench.query(0).expect("garbage is no failure") {
                assert_eq!(Some(level), expected);
                reported += 1;
            }
        }
        // A question takes four transfers, each spoilt with 0.2, some without harm.
        assert!(
            reported * 5 > requested && reported < requested,
            "AP {ap}: {reported} of {requested}"
        );
        bench.tick().expect("nothing fails");
        for _ in 0..5 {
            assert_eq!(bench.query(0).expect("nothing fails"), expected, "AP {ap}");
        }
    }
}

#[test]
fn after_a_reset_it_is_set_up_and_queried_again() {
    let mut bench = bench(quiet(), kind(Protocol::Zigbee, 2), config(false));
    let level = bench.query(1).expect("nothing fails");
    bench.radio.request(BeaconId(1)).expect("it is set up");
    bench.device.serve().expect("it is in memory");
    bench.device.reset().expect("it is in memory");
    let reported = (0..20).find_map(|_| bench.tick().expect("nothing fails"));
    assert_eq!(reported, level);
    assert_eq!(bench.radio.counts().queries, 3);
}

/// A cable that can be pulled, with another radio at it when it is put back.
struct Plug {
    stream: Rc<Cell<Option<MemoryStream>>>,
    times: Rc<Cell<u32>>,
}

impl ByteStream for Plug {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let mut stream = self.stream.take().ok_or(io::ErrorKind::BrokenPipe)?;
        let outcome = stream.receive(into);
        self.stream.set(Some(stream));
        outcome
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut stream = self.stream.take().ok_or(io::ErrorKind::BrokenPipe)?;
        let outcome = stream.send(bytes);
        self.stream.set(Some(stream));
        outcome
    }

    fn connections(&self) -> u32 {
        self.times.get()
    }
}

#[test]
fn a_pulled_cable_is_reported_and_another_radio_behind_it_set_up() {
    let world = World::new(&field(quiet()), 3).expect("a world");
    let (device, host) = memory_pair();
    let stream = Rc::new(Cell::new(Some(host)));
    let times = Rc::new(Cell::new(1));
    let plug = Plug { stream: Rc::clone(&stream), times: Rc::clone(&times) };
    let mut bench = Bench::new(world, kind(Protocol::Zigbee, 1), config(false), device, plug);
    let level = bench.query(0).expect("nothing fails");
    stream.take();
    assert!(matches!(bench.query(0), Err(XbeeError::Stream(_))));
    assert!(matches!(bench.radio.poll(), Err(XbeeError::Stream(_))), "each time");
    let (device, host) = memory_pair();
    stream.set(Some(host));
    times.set(2);
    let other = kind(Protocol::Ieee802154, 2);
    bench.device = EmulatedXbee::new(&bench.world, 0, other, device).expect("it is in order");
    assert_eq!(bench.query(0).expect("nothing fails"), level);
    let identity = bench.radio.identity().expect("it is set up");
    assert_eq!(identity.protocol, Protocol::Ieee802154);
}

#[test]
fn what_is_wrong_with_the_radio_is_reported_with_the_remedy() {
    let failure = |bench: &mut Bench<MemoryStream, MemoryStream>| {
        (0..1000).find_map(|_| bench.tick().err()).expect("it fails").to_string()
    };
    let mut transparent = bench(quiet(), kind(Protocol::Zigbee, 0), config(false));
    let text = failure(&mut transparent);
    assert!(text.contains("AP is 0") && text.contains("ATAP 1"), "{text}");
    assert!(transparent.radio.request(BeaconId(0)).is_err());

    let world = World::new(&field(quiet()), 3).expect("a world");
    let (_silent, host) = memory_pair();
    let (elsewhere, _nobody) = memory_pair();
    let mut silent = Bench::new(world, kind(Protocol::Zigbee, 1), config(false), elsewhere, host);
    let text = failure(&mut silent);
    assert!(text.contains("does not answer"), "{text}");

    let question = XbeeQuestion::ReceivedRssi;
    let mut mesh =
        bench(quiet(), kind(Protocol::Zigbee, 1), XbeeConfig { question, ..config(false) });
    assert!(failure(&mut mesh).contains("Zigbee firmware"));
    let mut short = bench(quiet(), kind(Protocol::DigiMesh, 1), config(true));
    assert!(failure(&mut short).contains("5000"));
    let mut good = bench(quiet(), kind(Protocol::Zigbee, 1), config(false));
    assert!(matches!(
        good.radio.request(BeaconId(7)),
        Err(XbeeError::Beacon { beacon: 7, beacons: 3 })
    ));
}

#[test]
fn a_look_at_it_reports_what_it_is_and_receives() {
    let mut good = bench(quiet(), kind(Protocol::Ieee802154, 2), config(true));
    let Bench { world, device, radio } = &mut good;
    let mut pause = || {
        world.advance(0.001).expect("time passes");
        device.serve().expect("it is in memory");
    };
    let findings = radio.examine(&mut pause);
    let text: Vec<_> = findings.iter().map(ToString::to_string).collect();
    assert!(text[0].contains("802.15.4 firmware 2003") && text[0].contains("AP 2"), "{text:?}");
    let level = direct(quiet(), &[0])[0].expect("it is received");
    assert!(text[2].contains(&format!("{level} dBm")) || text[2].contains(&format!("{level},")));
    assert!(findings[..4].iter().all(foxhunt::hardware::Finding::is_good), "{text:?}");
    assert!(text[4].contains("no acknowledgement"), "{text:?}");

    let mut transparent = bench(quiet(), kind(Protocol::Zigbee, 0), config(false));
    let Bench { world, device, radio } = &mut transparent;
    let findings = radio.examine(&mut || {
        world.advance(0.001).expect("time passes");
        device.serve().expect("it is in memory");
    });
    assert_eq!(findings.len(), 1);
    assert!(findings[0].to_string().contains("set AP to 1"), "{}", findings[0]);
}

/// Position and power of every sample, and the unanswered questions, of a turn for two beacons.
type Turn = Vec<(Vec<(u16, f64)>, Vec<u16>)>;

fn turn<S: PatternSource>(source: &mut S, mut tick: impl FnMut()) -> Turn {
    let mut turn = Turn::new();
    let mut ticks = 0;
    source.begin(&[BeaconId(1), BeaconId(0)]).unwrap_or_else(|error| panic!("{error}"));
    while turn.len() < 2 {
        tick();
        ticks += 1;
        assert!(ticks < 100_000, "the turn does not end");
        for _ in 0..30 {
            let sweep = source.poll().unwrap_or_else(|error| panic!("{error}"));
            if let Some(sweep) = sweep {
                let received = sweep.samples.iter().map(|s| (s.position, s.rss_dbm)).collect();
                turn.push((received, sweep.unanswered.iter().map(|u| u.position).collect()));
            }
        }
    }
    turn
}

#[test]
fn a_turn_through_the_radio_is_that_of_the_simulation() {
    for loss_probability in [0.0, 0.03] {
        let channel = ChannelConfig { loss_probability, floor_dbm: Some(-90.0), ..noisy() };
        let config_of_world = field(channel.clone());
        let world = World::new(&config_of_world, 9).expect("a world");
        let mut simulated = world.stepper(0, StepperConfig::pritzl2018()).expect("it exists");
        let expected = turn(&mut simulated, || world.advance(0.01).expect("time passes"));
        if loss_probability > 0.0 {
            assert!(expected.iter().all(|(_, unanswered)| !unanswered.is_empty()));
        } else {
            assert_eq!(expected[0].0.len(), 128 * 6);
        }
        for firmware in FIRMWARES {
            let world = World::new(&config_of_world, 9).expect("a world");
            let (device, host) = memory_pair();
            let kind = kind(firmware, 2);
            let device = EmulatedXbee::new(&world, 0, kind, device).expect("it is in order");
            let device = Rc::new(std::cell::RefCell::new(device));
            let host = Served { stream: host, device: Rc::clone(&device) };
            let radio = XbeeRadio::new(config(false), host, world.clock()).expect("in order");
            let (rotator, vehicle) =
                (world.rotator(0).expect("exists"), world.vehicle(0).expect("exists"));
            let settings = StepperConfig::pritzl2018();
            let mut source = StepperSource::new(settings, radio, rotator, vehicle, world.clock());
            let reported = turn(&mut source, || {
                world.advance(0.01).expect("time passes");
            });
            assert_eq!(reported, expected, "{firmware}, losses {loss_probability}");
        }
    }
}

/// A radio that is served whenever something is read from it, so that bytes take no time.
struct Served {
    stream: MemoryStream,
    device: Rc<std::cell::RefCell<EmulatedXbee<MemoryStream>>>,
}

impl ByteStream for Served {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        self.device.borrow_mut().serve()?;
        self.stream.receive(into)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.send(bytes)
    }
}
