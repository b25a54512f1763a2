//! The devices of a world as the bytes that they speak, over any
//! [`ByteStream`](foxhunt_wire::ByteStream); and the cable between, which may fail.

mod ardrone;
mod autopilot;
mod carrier;
mod gnss;
mod motion_capture;
mod receivers;
mod stepper;
mod xbee;

pub use ardrone::EmulatedArDrone;
pub use autopilot::{
    AutopilotConfig, AutopilotFaults, EmulatedAutopilot, FailsafeOrder, GpsStep, PilotOrder,
};
pub use carrier::EmulatedCarrier;
pub use gnss::{
    EmulatedCaster, EmulatedCasterConfig, EmulatedGnss, EmulatedGnssConfig, EmulatedGnssKind,
};
pub use motion_capture::{EmulatedMotionCapture, EmulatedMotionCaptureConfig};
pub use receivers::{
    EmulatedDongle, EmulatedKraken, EmulatedKrakenConfig, EmulatedRtlTcp, EmulatedRtlTcpConfig,
    InterfererConfig, PlayedPulse,
};
pub use stepper::{EmulatedStepper, EmulatedStepperConfig, EmulatedSwitch};
pub use xbee::{EmulatedXbee, EmulatedXbeeConfig, xbee_address};

use std::io;

use foxhunt_core::Clock;
use foxhunt_wire::ByteStream;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use serde::{Deserialize, Serialize};

use crate::{Interval, SimClock};

/// The share of what is sent that garbage comes before, and whose first byte is changed.
const GARBAGE: f64 = 0.2;

/// A device of a simulated world behind a stream of bytes.
pub trait Emulator {
    /// Takes what was sent to it, and sends what is due at the world's present time. Never
    /// blocks; to be called whenever time has passed, and as often as needed.
    ///
    /// # Errors
    ///
    /// Any error of its stream; it may be called again.
    fn serve(&mut self) -> io::Result<()>;
}

/// The faults of a cable, with their times in seconds of the world's time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CableFaults {
    /// It is pulled: nothing goes through, and a [port](Cabled::with_port) with a name
    /// outside is gone.
    pub pulled: Vec<Interval>,
    /// Bytes that nobody sent come in between, and some that were sent are changed.
    pub garbage: Vec<Interval>,
}

/// A port with a name outside, such as a pseudo-terminal's.
pub trait Port<S> {
    /// Opens the port again after its cable was put back.
    ///
    /// # Errors
    ///
    /// Any error of the system; it is tried again.
    fn open(&mut self) -> io::Result<S>;

    /// Takes its name away, after its cable was pulled: the system may give the same port to
    /// another device.
    ///
    /// # Errors
    ///
    /// Any error of the system.
    fn close(&mut self) -> io::Result<()>;
}

/// A device's end of a cable that has faults.
pub struct Cabled<S> {
    stream: Option<S>,
    port: Option<Box<dyn Port<S>>>,
    clock: SimClock,
    faults: CableFaults,
    random: Xoshiro256PlusPlus,
}

impl<S: std::fmt::Debug> std::fmt::Debug for Cabled<S> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Cabled")
            .field("stream", &self.stream)
            .field("faults", &self.faults)
            .finish_non_exhaustive()
    }
}

impl<S: ByteStream> Cabled<S> {
    /// A cable on a stream. What its garbage looks like is drawn from `seed`.
    #[must_use]
    pub fn new(stream: S, clock: SimClock, faults: CableFaults, seed: u64) -> Self {
        let random = Xoshiro256PlusPlus::seed_from_u64(seed);
        Self { stream: Some(stream), port: None, clock, faults, random }
    }

    /// While the cable is pulled the stream is closed, and `port` opens the next one.
    #[must_use]
    pub fn with_port(mut self, port: impl Port<S> + 'static) -> Self {
        self.port = Some(Box::new(port));
        self
    }

    fn is(&self, times: &[Interval]) -> bool {
        times.iter().any(|interval| interval.contains(self.clock.now()))
    }

    /// The stream, if the cable is in.
    fn plugged(&mut self) -> io::Result<Option<&mut S>> {
        if self.is(&self.faults.pulled) {
            if let Some(port) = &mut self.port
                && self.stream.take().is_some()
            {
                port.close()?;
            }
            return Ok(None);
        }
        if let (None, Some(port)) = (&self.stream, &mut self.port) {
            self.stream = Some(port.open()?);
        }
        Ok(self.stream.as_mut())
    }
}

impl<S: ByteStream> ByteStream for Cabled<S> {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let pulled = self.is(&self.faults.pulled);
        let garbage = self.is(&self.faults.garbage) && self.random.random::<f64>() < GARBAGE;
        let flip: u8 = self.random.random();
        let Some(stream) = self.plugged()? else {
            // What was sent into a pulled cable is lost.
            if let Some(stream) = self.stream.as_mut().filter(|_| pulled) {
                while stream.receive(into)? > 0 {}
            }
            return Ok(0);
        };
        let count = stream.receive(into)?;
        if let Some(first) = into[..count].first_mut().filter(|_| garbage) {
            *first ^= flip;
        }
        Ok(count)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let noise: [u8; 7] = self.random.random();
        let garbage = self.is(&self.faults.garbage) && self.random.random::<f64>() < GARBAGE;
        let Some(stream) = self.plugged()? else { return Ok(()) };
        if garbage {
            stream.send(&noise)?;
        }
        stream.send(bytes)
    }

    fn connections(&self) -> u32 {
        self.stream.as_ref().map_or(0, ByteStream::connections)
    }
}

#[cfg(test)]
mod tests {
    use foxhunt_wire::memory_pair;

    use super::*;
    use crate::{BeaconConfig, DroneConfig, World, WorldConfig};

    #[test]
    fn a_pulled_cable_loses_what_is_sent_and_garbage_comes_between() {
        let config = WorldConfig {
            beacons: vec![BeaconConfig::default()],
            drones: vec![DroneConfig::default()],
            ..WorldConfig::default()
        };
        let world = World::new(&config, 1).expect("a world");
        let faults = CableFaults {
            pulled: vec![Interval { from_s: 1.0, to_s: Some(2.0) }],
            garbage: vec![Interval { from_s: 3.0, to_s: Some(4.0) }],
        };
        let (device, mut host) = memory_pair();
        let mut device = Cabled::new(device, world.clock(), faults, 7);
        let mut exchange = |device: &mut Cabled<_>, word: &[u8]| {
            device.send(word).expect("it is in memory");
            let mut into = [0; 64];
            let count = host.receive(&mut into).expect("it is in memory");
            host.send(b"back").expect("it is in memory");
            let mut incoming = [0; 64];
            let back = device.receive(&mut incoming).expect("it is in memory");
            (into[..count].to_vec(), incoming[..back].to_vec())
        };
        assert_eq!(exchange(&mut device, b"one"), (b"one".to_vec(), b"back".to_vec()));
        world.advance(1.5).expect("time passes");
        assert_eq!(exchange(&mut device, b"two"), (Vec::new(), Vec::new()));
        world.advance(1.0).expect("time passes");
        assert_eq!(exchange(&mut device, b"three"), (b"three".to_vec(), b"back".to_vec()));
        world.advance(1.0).expect("time passes");
        let spoilt = (0..200).filter(|_| exchange(&mut device, b"four").0 != b"four").count();
        // Binomial, 200 of 0.2: 40 ± 4 sigma of 5.7.
        assert!((17..=63).contains(&spoilt), "{spoilt}");
    }
}
