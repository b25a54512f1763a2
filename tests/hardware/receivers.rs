//! Other receivers against their emulated servers.

use std::{cell::RefCell, f64::consts::TAU, io, rc::Rc};

use foxhunt::{
    core::{BeaconId, PatternSource, Radio, angle, laws},
    hardware::{KrakenConfig, KrakenSource, RtlTcpConfig, RtlTcpRadio},
    sim::{
        BeaconConfig, ChannelConfig, DroneConfig, EmulatedKraken, EmulatedKrakenConfig,
        EmulatedRtlTcp, EmulatedRtlTcpConfig, Emulator, SimClock, SimVehicle, World, WorldConfig,
    },
    wire::{ByteStream, MemoryStream, memory_pair},
};

fn world() -> World {
    let beacon = |east_m, north_m, appears_after_s| BeaconConfig {
        east_m,
        north_m,
        appears_after_s,
        ..BeaconConfig::default()
    };
    let quiet = ChannelConfig {
        pattern_sigma_db: 0.0,
        sample_sigma_db: 0.0,
        bearing_sigma_deg: 0.0,
        frequency_mhz: 433.92,
        ..ChannelConfig::default()
    };
    let drone = DroneConfig { up_m: 4.0, heading_deg_ccw_from_east: 30.0, ..Default::default() };
    let config = WorldConfig {
        beacons: vec![
            beacon(20.0, 5.0, None),
            beacon(-9.0, 14.0, None),
            beacon(3.0, 3.0, Some(1e6)),
        ],
        drones: vec![drone],
        channel: quiet,
        ..WorldConfig::default()
    };
    World::new(&config, 3).expect("a world")
}

/// The level in the world itself.
fn level(world: &World, beacon: u16) -> f64 {
    let mut radio = world.radio(0).expect("it exists");
    radio.request(BeaconId(beacon)).expect("it exists");
    world.advance(0.1).expect("time passes");
    radio.poll().expect("it never fails").expect("it is received")
}

fn rtl_tcp() -> RtlTcpConfig {
    RtlTcpConfig {
        frequencies_hz: vec![433_920_000, 433_970_000, 434_020_000],
        sample_rate_hz: 250_000,
        beside_hz: 20_000,
        gain_db: 30.0,
        settling_s: 0.05,
        full_scale_dbm: -30.0,
        ..RtlTcpConfig::default()
    }
}

/// Level received within three seconds of a question.
fn query<R: Radio>(
    radio: &mut R,
    beacon: u16,
    mut tick: impl FnMut(),
) -> Result<Option<f64>, R::Error> {
    radio.request(BeaconId(beacon))?;
    for _ in 0..300 {
        tick();
        if let Some(level) = radio.poll()? {
            return Ok(Some(level));
        }
    }
    Ok(None)
}

#[test]
fn the_power_of_pulses_is_measured_through_rtl_tcp() {
    let world = world();
    let expected = [level(&world, 0), level(&world, 1)];
    let (device, host) = memory_pair();
    let quiet = EmulatedRtlTcpConfig { noise_steps: 0.5, ..EmulatedRtlTcpConfig::default() };
    let mut server = EmulatedRtlTcp::new(&world, 0, quiet, device).expect("it is in order");
    // With rounding, the noise in a block of 50 samples has -91 dBm; a tenth of it is above -87.
    let floor_dbm = Some(-84.0);
    let config = RtlTcpConfig { floor_dbm, ..rtl_tcp() };
    let mut radio = RtlTcpRadio::new(config, host, world.clock()).expect("it is in order");
    let mut tick = || {
        world.advance(0.01).expect("time passes");
        server.serve().expect("it is in memory");
    };
    for beacon in [0, 1, 1, 0] {
        let reported =
            query(&mut radio, beacon, &mut tick).expect("nothing fails").expect("it is received");
        let apart = reported - expected[usize::from(beacon)];
        assert!(apart.abs() < 1.5, "beacon {beacon}: {reported} dBm, {expected:?}");
    }
    assert_eq!(query(&mut radio, 2, &mut tick).expect("nothing fails"), None, "it is silent");
    assert!(radio.request(BeaconId(3)).is_err());
    let text: Vec<_> = radio.examine(&mut tick).iter().map(ToString::to_string).collect();
    assert!(text[0].contains("tuner 5, 29 gains"), "{text:?}");
    assert!(text[1].contains("dBm") && text[3].contains("below floor_dbm"), "{text:?}");
}

#[test]
fn a_server_that_is_none_or_silent_is_reported() {
    let world = world();
    let (mut device, host) = memory_pair();
    let mut radio = RtlTcpRadio::new(rtl_tcp(), host, world.clock()).expect("it is in order");
    assert_eq!(radio.poll().expect("it has time"), None);
    world.advance(3.0).expect("time passes");
    assert!(radio.poll().expect_err("it is silent").to_string().contains("nothing for 3.0 s"));
    device.send(b"HTTP/1.1 400 Bad Request").expect("it is in memory");
    assert!(radio.poll().expect_err("it is another").to_string().contains("RTL0"));
}

/// A connection to a server that is served whenever something is read from it.
struct Served {
    stream: Rc<RefCell<MemoryStream>>,
    server: Rc<RefCell<EmulatedKraken<MemoryStream>>>,
}

impl ByteStream for Served {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        self.server.borrow_mut().serve()?;
        self.stream.borrow_mut().receive(into)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.borrow_mut().send(bytes)
    }
}

#[expect(clippy::type_complexity, reason = "the connection's maker has no name")]
fn kraken(
    world: &World,
    torn: f64,
) -> (
    KrakenSource<Served, impl FnMut() -> io::Result<Served>, SimVehicle, SimClock>,
    Rc<RefCell<EmulatedKraken<MemoryStream>>>,
) {
    let (device, host) = memory_pair();
    let config = EmulatedKrakenConfig { sigma_deg: 0.0, torn, ..EmulatedKrakenConfig::default() };
    let server = EmulatedKraken::new(world, 0, config, device).expect("it is in order");
    let server = Rc::new(RefCell::new(server));
    let stream = Rc::new(RefCell::new(host));
    let kept = Rc::clone(&server);
    let open = move || Ok(Served { stream: Rc::clone(&stream), server: Rc::clone(&server) });
    let config = KrakenConfig {
        frequencies_hz: vec![433.92e6, 433.97e6, 434.02e6],
        ..KrakenConfig::default()
    };
    let vehicle = world.vehicle(0).expect("it exists");
    let source = KrakenSource::new(config, open, vehicle, world.clock()).expect("it is in order");
    (source, kept)
}

#[test]
fn a_kraken_is_a_source_of_turns() {
    let world = world();
    let (mut source, server) = kraken(&world, 0.2);
    let tick = || {
        world.advance(0.02).expect("time passes");
        server.borrow_mut().serve().expect("it is in memory");
    };
    for _ in 0..5 {
        laws::pattern_source(&mut source, &[BeaconId(1), BeaconId(0)], 1000, tick);
    }
    source.begin(&[BeaconId(0), BeaconId(2), BeaconId(1)]).unwrap_or_else(|e| panic!("{e}"));
    let begun = world.time();
    let mut reported = Vec::new();
    while reported.len() < 3 && world.time() < begun + 10.0 {
        tick();
        while let Some(sweep) = source.poll().unwrap_or_else(|e| panic!("{e}")) {
            assert!(sweep.samples.iter().all(|sample| sample.time > begun));
            let best = sweep.samples.iter().max_by(|a, b| a.rss_dbm.total_cmp(&b.rss_dbm));
            // The mean over all directions is the power.
            let mean = sweep.samples.iter().map(|sample| sample.rss_dbm / 360.0).sum::<f64>();
            reported.push((sweep.beacon.0, best.map(|best| (best.boresight, mean))));
        }
    }
    let [(0, Some((first, level))), (2, None), (1, Some((second, _)))] = reported[..] else {
        panic!("{reported:?}")
    };
    // The bins are a degree wide.
    assert!(angle::distance(first, 5.0_f64.atan2(20.0)) < TAU / 720.0 + 1e-9, "{first}");
    assert!(angle::distance(second, 14.0_f64.atan2(-9.0)) < TAU / 720.0 + 1e-9, "{second}");
    assert!((-75.0..-55.0).contains(&level), "{level}");
    assert!(source.begin(&[BeaconId(3)]).is_err());
    let (mut whole, server) = kraken(&world, 0.0);
    let mut pause = || {
        world.advance(0.05).expect("time passes");
        server.borrow_mut().serve().expect("it is in memory");
    };
    (0..40).for_each(|_| pause());
    let text: Vec<_> = whole.examine(&mut pause).iter().map(ToString::to_string).collect();
    // The nose is at 30 degrees, and the beacon at 14.
    assert!(text[0].contains("from 344 degrees"), "{text:?}");
    assert!(text[2].contains("no channel"), "{text:?}");
}
