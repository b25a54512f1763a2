//! Samples of an RTL-SDR that come, stall, and come again: each at its place in time, once.

use approx::assert_abs_diff_eq;
use std::{cell::RefCell, collections::VecDeque, io, rc::Rc};

use foxhunt::{
    hardware::{RtlTcpRadioError, RtlTcpSamples, RtlTcpTuning},
    signal::{
        Complex32,
        detector::{Detector, DetectorConfig},
        samples::SampleFormat,
    },
    sim::{
        BeaconConfig, ChannelConfig, DroneConfig, EmulatedRtlTcp, EmulatedRtlTcpConfig, Emulator,
        PlayedPulse, PulseTrain, SimClock, World, WorldConfig,
    },
    wire::ByteStream,
};

/// A network between a server and its client: what is sent waits while it is held up, is lost while
/// it is cut, and goes with the connection.
#[derive(Default)]
struct Network {
    to_client: VecDeque<u8>,
    to_server: VecDeque<u8>,
    connections: u32,
    is_held_up: bool,
    is_cut: bool,
}

type Shared = Rc<RefCell<Network>>;

struct ServerEnd(Shared);
struct ClientEnd(Shared);

fn drain(from: &mut VecDeque<u8>, into: &mut [u8]) -> usize {
    let count = from.len().min(into.len());
    for (to, from) in into.iter_mut().zip(from.drain(..count)) {
        *to = from;
    }
    count
}

impl ByteStream for ServerEnd {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        Ok(drain(&mut self.0.borrow_mut().to_server, into))
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut network = self.0.borrow_mut();
        if !network.is_cut {
            network.to_client.extend(bytes);
        }
        Ok(())
    }

    fn connections(&self) -> u32 {
        self.0.borrow().connections
    }
}

impl ByteStream for ClientEnd {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let mut network = self.0.borrow_mut();
        if network.is_held_up {
            return Ok(0);
        }
        Ok(drain(&mut network.to_client, into))
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.borrow_mut().to_server.extend(bytes);
        Ok(())
    }

    fn connections(&self) -> u32 {
        self.0.borrow().connections
    }

    fn renew(&mut self) {
        let mut network = self.0.borrow_mut();
        // A network that is cut cannot be connected through.
        if !network.is_cut {
            network.to_client.clear();
            network.to_server.clear();
            network.is_held_up = false;
            network.connections += 1;
        }
    }
}

/// Results of a listener in a minute of samples.
struct Listened {
    /// Pulses found, in seconds of the world's time.
    found: Vec<f64>,
    played: Vec<PlayedPulse>,
    /// Times at which it was noticed that nothing comes.
    silent_at: Vec<f64>,
    samples: RtlTcpSamples<ClientEnd, SimClock>,
}

/// Listens for a minute to a tag of 20 ms each 1.3 s; `act` does things to the network.
fn listen(mut act: impl FnMut(f64, &mut Network)) -> Listened {
    let pulses = PulseTrain { pulse_s: 0.02, interval_s: 1.3, jitter_s: 0.0, phase_s: 0.4 };
    let beacon = BeaconConfig { north_m: 10.0, pulses: Some(pulses), ..BeaconConfig::default() };
    let config = WorldConfig {
        beacons: vec![BeaconConfig { frequency_mhz: Some(150.1), ..beacon }],
        drones: vec![DroneConfig::default()],
        channel: ChannelConfig { sample_sigma_db: 0.0, ..ChannelConfig::default() },
        ..WorldConfig::default()
    };
    let world = World::new(&config, 3).expect("a world");
    let network: Shared = Rc::default();
    network.borrow_mut().connections = 1;
    let server = ServerEnd(Rc::clone(&network));
    let quiet = EmulatedRtlTcpConfig::default();
    let mut server = EmulatedRtlTcp::new(&world, 0, quiet, server).expect("it is in order");
    // Not a rate that a real one has, which makes the test short.
    let mut tuning = RtlTcpTuning::new(150_098_000, 16_000);
    tuning.settling_s = 0.2;
    let client = ClientEnd(Rc::clone(&network));
    let mut samples = RtlTcpSamples::new(tuning, client, world.clock()).expect("it is in order");
    let mut detector = DetectorConfig::new(16_000.0);
    detector.widths_s = vec![0.02];
    let mut detector = Detector::new(detector).expect("it is in order");
    let mut bytes = Vec::new();
    let mut decoded = Vec::<Complex32>::new();
    let mut found = Vec::new();
    let mut listened_until = 0;
    let mut played = Vec::new();
    let mut silent_at = Vec::new();
    while world.time() < 60.0 {
        world.advance(0.01).expect("time passes");
        act(world.time(), &mut network.borrow_mut());
        server.serve().expect("it is in memory");
        played.extend(server.played());
        loop {
            match samples.poll(&mut bytes) {
                Ok(None) => break,
                Ok(Some(first)) => {
                    assert!(first >= listened_until, "{first} after {listened_until}");
                    listened_until = first + bytes.len() as u64 / 2;
                    decoded.clear();
                    SampleFormat::Cu8.decode(&bytes, &mut decoded);
                    detector.push(first, &decoded, &mut found).expect("indices rise");
                }
                Err(RtlTcpRadioError::Silent { .. }) => {
                    silent_at.push(world.time());
                    break;
                }
                Err(error) => panic!("{error}"),
            }
        }
    }
    detector.finish(&mut found);
    let place = |time_s: f64| samples.time_of(time_s * 16_000.0).expect("it has begun");
    let found = found.iter().map(|found| place(found.pulse.time_s)).collect();
    Listened { found, played, silent_at, samples }
}

/// Each pulse played in `times` is found once at its time, and no other.
fn assert_found(listened: &Listened, lost: std::ops::Range<f64>, within_s: f64) {
    let inside = |time: f64| time > 1.5 && time < 59.0 && !lost.contains(&time);
    let played: Vec<f64> =
        listened.played.iter().map(|p| p.time_s).filter(|time| inside(*time)).collect();
    let found: Vec<f64> = listened.found.iter().copied().filter(|time| inside(*time)).collect();
    assert_eq!(found.len(), played.len(), "{found:?} for {played:?}");
    for (found, played) in found.iter().zip(&played) {
        assert_abs_diff_eq!(found, played, epsilon = within_s);
    }
}

#[test]
fn what_is_held_up_for_a_moment_is_late_and_not_lost() {
    let listened = listen(|time, network| {
        network.is_held_up = (20.0..20.7).contains(&time) || (40.0..40.5).contains(&time);
    });
    assert_found(&listened, 0.0..0.0, 2e-3);
    assert!(listened.silent_at.is_empty(), "{:?}", listened.silent_at);
    assert_eq!(listened.samples.losses().samples, 0);
}

#[test]
fn a_stream_that_stalls_is_noticed_in_a_second_and_goes_on_at_its_time() {
    let listened = listen(|time, network| {
        if (20.0..20.01).contains(&time) {
            // Until it is opened again.
            network.is_held_up = true;
        }
    });
    let noticed = listened.silent_at[0];
    assert!((20.0..21.0).contains(&noticed), "{noticed}");
    let losses = listened.samples.losses();
    assert_eq!((losses.stalls, losses.gaps), (1, 1));
    // From 20 s until it was opened again, and what settling takes.
    assert!((16_000..22_400).contains(&losses.samples), "{losses:?}");
    assert_found(&listened, 19.9..21.5, 2e-3);
}

#[test]
fn a_network_that_is_cut_for_long_costs_no_more_than_that() {
    let listened = listen(|time, network| network.is_cut = (20.0..30.0).contains(&time));
    assert!((20.0..21.0).contains(&listened.silent_at[0]), "{:?}", listened.silent_at[0]);
    assert_found(&listened, 19.9..33.5, 2e-3);
}

#[test]
fn samples_that_a_server_drops_are_jumped_over() {
    // Too short to be a stall: the count lags behind until that is known.
    let listened = listen(|time, network| network.is_cut = (20.0..20.5).contains(&time));
    assert!(listened.silent_at.is_empty(), "{:?}", listened.silent_at);
    let losses = listened.samples.losses();
    assert_eq!(losses.gaps, 1);
    assert!(losses.samples.abs_diff(8000) < 500, "{losses:?}");
    assert_found(&listened, 19.9..23.6, 0.02);
}
