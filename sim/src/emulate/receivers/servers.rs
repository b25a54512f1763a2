//! Servers on a simulated drone: rtl_tcp's, and the page of a `KrakenSDR`.

use std::io;

use foxhunt_core::{
    BeaconId, Clock, Radio, angle,
    parameter::{FieldError, ParameterError, in_range, probability},
};
use foxhunt_wire::{
    ByteStream,
    receivers::{KrakenDoa, RtlTcpCommand, RtlTcpHeader},
};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use super::{EmulatedDongle, EmulatedRtlTcpConfig, PlayedPulse};
use crate::{Emulator, SimClock, SimError, SimRadio, World};

/// The gain that a tuner sets by itself, in dB.
const AUTOMATIC_GAIN_DB: f64 = 30.0;

/// The width of the pseudo-spectrum's lobe: the angle aside at which it is 3 dB down, in degrees.
const LOBE_DEG: f64 = 12.0;

/// A measurement's time by its own clock, of the beginning, in milliseconds.
const EPOCH_MS: u64 = 1_700_000_000_000;

/// A server of rtl_tcp, whose [receiver](EmulatedDongle) stands under the antenna of a simulated
/// drone.
#[derive(Debug)]
pub struct EmulatedRtlTcp<S> {
    stream: S,
    dongle: EmulatedDongle,
    /// Connections whose client was met.
    met: u32,
    begun: Vec<u8>,
}

impl<S: ByteStream> EmulatedRtlTcp<S> {
    /// A server whose clients come over `stream`.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone; [`SimError::Field`] names what is out of
    /// range in
    /// `config`.
    pub fn new(
        world: &World,
        drone: usize,
        config: EmulatedRtlTcpConfig,
        stream: S,
    ) -> Result<Self, SimError> {
        let dongle = EmulatedDongle::new(world, drone, config)?;
        Ok(Self { stream, dongle, met: 0, begun: Vec::new() })
    }

    /// The pulses that have begun in samples since the last call.
    pub fn played(&mut self) -> Vec<PlayedPulse> {
        self.dongle.played()
    }

    fn obey(&mut self, bytes: &[u8]) {
        self.begun.extend(bytes);
        while let Some((command, rest)) = self.begun.split_first_chunk() {
            match RtlTcpCommand::decode(*command) {
                RtlTcpCommand::Frequency(hz) => self.dongle.tune(hz),
                RtlTcpCommand::SampleRate(hz) => self.dongle.set_rate(hz),
                RtlTcpCommand::Gain(tenths) => self.dongle.set_gain(f64::from(tenths) / 10.0),
                RtlTcpCommand::ManualGain(false) => self.dongle.set_gain(AUTOMATIC_GAIN_DB),
                RtlTcpCommand::Correction(ppm) => self.dongle.set_correction(ppm),
                _ => {}
            }
            self.begun = rest.to_vec();
        }
    }
}

impl<S: ByteStream> Emulator for EmulatedRtlTcp<S> {
    fn serve(&mut self) -> io::Result<()> {
        let mut bytes = [0; 512];
        let count = self.stream.receive(&mut bytes)?;
        let connections = self.stream.connections();
        if connections != self.met {
            self.met = connections;
            self.begun.clear();
            // An R820T with its 29 gains.
            self.stream.send(&RtlTcpHeader { tuner: 5, gains: 29 }.encode())?;
            self.dongle.restart();
        }
        self.obey(bytes.get(..count).unwrap_or_default());
        if connections == 0 {
            return Ok(());
        }
        let samples = self.dongle.take();
        match self.stream.send(&samples) {
            // Nobody is there any more; another may come.
            Err(error) if error.kind() == io::ErrorKind::NotConnected => Ok(()),
            other => other,
        }
    }
}

/// The settings of an emulated `KrakenSDR`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EmulatedKrakenConfig {
    /// The frequency of each beacon of the world, in Hz; beacons without one send nothing.
    pub frequencies_hz: Vec<f64>,
    /// Time from one measurement of a channel to the next, in seconds.
    pub period_s: f64,
    /// σ of a measurement's direction, in degrees.
    pub sigma_deg: f64,
    /// The share of pages that are torn: read while they are written.
    pub torn: f64,
    /// The seed of errors and torn pages.
    pub seed: u64,
}

/// 433.92 MHz and a channel of 50 kHz more for every other beacon up to four; 0.4 s, 3°, one page
/// of ten torn.
impl Default for EmulatedKrakenConfig {
    fn default() -> Self {
        Self {
            frequencies_hz: vec![433.92e6, 433.97e6, 434.02e6, 434.07e6],
            period_s: 0.4,
            sigma_deg: 3.0,
            torn: 0.1,
            seed: 1,
        }
    }
}

impl EmulatedKrakenConfig {
    fn check(&self) -> Result<(), ParameterError> {
        in_range("period_s", self.period_s, 1e-3..=1e3, "from 0.001 to 1000")?;
        in_range("sigma_deg", self.sigma_deg, 0.0..=180.0, "from 0 to 180")?;
        probability("torn", self.torn)?;
        Ok(())
    }
}

/// The server of a `KrakenSDR` on a simulated drone, its front along the nose: answers every
/// question for the page with what was measured last.
///
/// It has no antenna to turn: it reports the powers of an antenna with equal gain in all
/// directions, and the world's directions with an error.
#[derive(Debug)]
pub struct EmulatedKraken<S> {
    stream: S,
    world: World,
    drone: usize,
    clock: SimClock,
    radio: SimRadio,
    config: EmulatedKrakenConfig,
    random: Xoshiro256PlusPlus,
    /// The last line of each beacon that was received.
    lines: Vec<Option<KrakenDoa>>,
    /// The beacon to be measured next; the one being measured, and until when.
    next: u16,
    measuring: Option<(BeaconId, f64)>,
    incoming: Vec<u8>,
    met: u32,
}

impl<S: ByteStream> EmulatedKraken<S> {
    /// A server whose questions come over `stream`.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone; [`SimError::Field`] names what is out of
    /// range in
    /// `config`.
    pub fn new(
        world: &World,
        drone: usize,
        config: EmulatedKrakenConfig,
        stream: S,
    ) -> Result<Self, SimError> {
        config.check().map_err(FieldError::from)?;
        let lines = config.frequencies_hz.iter().map(|_| None).collect();
        Ok(Self {
            stream,
            world: world.clone(),
            drone,
            clock: world.clock(),
            radio: SimRadio { directional: false, ..world.radio(drone)? },
            random: Xoshiro256PlusPlus::seed_from_u64(config.seed),
            config,
            lines,
            next: 0,
            measuring: None,
            incoming: Vec::new(),
            met: 0,
        })
    }

    /// Measures one channel after the other, all within a period.
    fn measure(&mut self, now: f64) {
        let channels = u16::try_from(self.lines.len()).unwrap_or(u16::MAX);
        let Some(last) = channels.checked_sub(1) else { return };
        match self.measuring {
            None => {
                let beacon = BeaconId(self.next);
                self.next = if self.next < last { self.next + 1 } else { 0 };
                // A channel without a beacon stays silent.
                let _ = self.radio.request(beacon);
                let until = now + self.config.period_s / f64::from(channels);
                self.measuring = Some((beacon, until));
            }
            Some((beacon, until)) if now >= until => {
                self.measuring = None;
                let level = self.radio.poll().ok().flatten();
                let line = level.and_then(|level| self.line(beacon, level, now));
                if let (Some(line), Some(slot)) = (line, self.lines.get_mut(usize::from(beacon.0)))
                {
                    *slot = Some(line);
                }
            }
            Some(_) => {}
        }
    }

    fn line(&mut self, beacon: BeaconId, level: f64, now: f64) -> Option<KrakenDoa> {
        let pose = self.world.pose(self.drone).ok()?;
        let to = self.world.truth(beacon)? - pose.position;
        let error: f64 = self.random.sample(StandardNormal);
        let aslant = self.world.bearing_offset(self.drone).ok()?;
        let error = aslant + self.config.sigma_deg.to_radians() * error;
        let direction = angle::wrap(to.y.atan2(to.x) - pose.heading + error);
        let spectrum = (0..360).map(|degree| {
            let aside = angle::distance(f64::from(degree).to_radians(), direction).to_degrees();
            (-3.0 * (aside / LOBE_DEG).powi(2)).max(-100.0)
        });
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "time passes")]
        let unix_ms = EPOCH_MS + (now * 1e3) as u64;
        Some(KrakenDoa {
            unix_ms,
            confidence: 9.0,
            power_db: level,
            frequency_hz: *self.config.frequencies_hz.get(usize::from(beacon.0))?,
            spectrum_db: spectrum.collect(),
        })
    }

    /// The answer to a question.
    fn answer(&mut self, question: &[u8]) -> Vec<u8> {
        if !question.starts_with(b"GET /DOA_value.html ") {
            return b"HTTP/1.0 404 Not Found\r\nContent-Length: 0\r\n\r\n".to_vec();
        }
        let mut body: String = self.lines.iter().flatten().map(KrakenDoa::write).collect();
        if self.random.random::<f64>() < self.config.torn {
            let half = body.len() / 2;
            body.truncate(half);
        }
        let length = body.len();
        format!("HTTP/1.0 200 OK\r\nContent-Length: {length}\r\n\r\n{body}").into_bytes()
    }
}

impl<S: ByteStream> Emulator for EmulatedKraken<S> {
    fn serve(&mut self) -> io::Result<()> {
        self.measure(self.clock.now());
        let mut bytes = [0; 1024];
        let count = self.stream.receive(&mut bytes)?;
        let connections = self.stream.connections();
        if connections != self.met {
            self.met = connections;
            self.incoming.clear();
        }
        self.incoming.extend(bytes.get(..count).unwrap_or_default());
        while let Some(end) = self.incoming.windows(4).position(|four| four == b"\r\n\r\n") {
            let question: Vec<u8> = self.incoming.drain(..end + 4).collect();
            let answer = self.answer(&question);
            self.stream.send(&answer)?;
        }
        // What never ends is no question.
        if self.incoming.len() > 8192 {
            self.incoming.clear();
        }
        Ok(())
    }
}
