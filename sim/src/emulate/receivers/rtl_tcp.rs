use std::{f64::consts::TAU, io};

use foxhunt_core::{
    BeaconId, Clock, Radio,
    parameter::{FieldError, ParameterError, finite, in_range},
};
use foxhunt_wire::{
    ByteStream,
    receivers::{RtlTcpCommand, RtlTcpHeader},
};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use super::keyed::sends;
use crate::{Emulator, SimClock, SimError, SimRadio, World};

/// What an emulated RTL-SDR is like.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EmulatedRtlTcpConfig {
    /// What each beacon of the world sends at, in Hz; those without a frequency send nothing.
    pub frequencies_hz: Vec<u32>,
    /// The power of a tone at full scale with a gain of 0, in dBm.
    pub full_scale_dbm: f64,
    /// σ of the noise of each I and Q, in steps of a byte.
    pub noise_steps: f64,
    /// The seed of the noise.
    pub seed: u64,
}

/// 433.92 MHz and a channel of 50 kHz more for every other beacon up to four; 0 dBm, 0.7 steps.
impl Default for EmulatedRtlTcpConfig {
    fn default() -> Self {
        Self {
            frequencies_hz: vec![433_920_000, 433_970_000, 434_020_000, 434_070_000],
            full_scale_dbm: 0.0,
            noise_steps: 0.7,
            seed: 1,
        }
    }
}

impl EmulatedRtlTcpConfig {
    fn check(&self) -> Result<(), ParameterError> {
        in_range("noise_steps", self.noise_steps, 0.0..=50.0, "from 0 to 50")?;
        finite("full_scale_dbm", self.full_scale_dbm)?;
        Ok(())
    }
}

/// A server of rtl_tcp, whose receiver stands under the antenna of a simulated drone.
///
/// Every beacon is keyed on and off, 16 bits of 1 ms in every 50 ms, as a carrier at its frequency.
/// Of those in the band that it is tuned to, the one nearest to the middle is received, with the
/// power that the world has, requested every 10 ms.
#[derive(Debug)]
pub struct EmulatedRtlTcp<S> {
    stream: S,
    clock: SimClock,
    radio: SimRadio,
    config: EmulatedRtlTcpConfig,
    random: Xoshiro256PlusPlus,
    /// Connections whose client was met.
    met: u32,
    begun: Vec<u8>,
    rate_hz: u32,
    middle_hz: u32,
    gain_db: f64,
    /// The samples until then were sent.
    sent_until: f64,
    requested_at: f64,
    /// Whom the radio was requested, and what it last said.
    incoming: Option<(BeaconId, Option<f64>)>,
    /// Of the carrier, in turns.
    phase: f64,
}

/// From one question for the power to the next, in seconds.
const REFRESH_S: f64 = 0.01;
/// What a client that was not served for long is sent at once, in seconds.
const MOST_S: f64 = 0.2;

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
        config.check().map_err(FieldError::from)?;
        Ok(Self {
            stream,
            clock: world.clock(),
            radio: world.radio(drone)?,
            random: Xoshiro256PlusPlus::seed_from_u64(config.seed),
            middle_hz: config.frequencies_hz.first().copied().unwrap_or(100_000_000),
            config,
            met: 0,
            begun: Vec::new(),
            rate_hz: 250_000,
            gain_db: 0.0,
            sent_until: world.time(),
            requested_at: f64::NEG_INFINITY,
            incoming: None,
            phase: 0.0,
        })
    }

    fn obey(&mut self, bytes: &[u8]) {
        self.begun.extend(bytes);
        while let Some((command, rest)) = self.begun.split_first_chunk() {
            match RtlTcpCommand::decode(*command) {
                RtlTcpCommand::Frequency(hz) => self.middle_hz = hz,
                RtlTcpCommand::SampleRate(hz) if (1..=4_000_000).contains(&hz) => self.rate_hz = hz,
                RtlTcpCommand::Gain(tenths) => self.gain_db = f64::from(tenths) / 10.0,
                RtlTcpCommand::ManualGain(false) => self.gain_db = 30.0,
                _ => {}
            }
            self.begun = rest.to_vec();
        }
    }

    /// Whom it receives, and how far from the middle, in Hz.
    fn received(&self) -> Option<(BeaconId, f64)> {
        let aside = |hz: u32| f64::from(hz) - f64::from(self.middle_hz);
        let near = (0..).map(BeaconId).zip(self.config.frequencies_hz.iter().map(|hz| aside(*hz)));
        near.filter(|(_, aside)| aside.abs() < f64::from(self.rate_hz) / 2.0)
            .min_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
    }

    /// Asks the world for the power now and then.
    fn refresh(&mut self, beacon: BeaconId, now: f64) -> Option<f64> {
        let known = self.incoming.filter(|(of, _)| *of == beacon);
        if known.is_none() || now >= self.requested_at + REFRESH_S {
            // A question that stayed without an answer: nothing is received.
            let last = if known.is_some() { self.radio.poll().ok().flatten() } else { None };
            let _ = self.radio.request(beacon);
            self.requested_at = now;
            self.incoming = Some((beacon, last));
        }
        self.incoming.and_then(|(_, level)| level)
    }

    fn samples(&mut self, now: f64) -> Vec<u8> {
        let rate = f64::from(self.rate_hz);
        let begin = self.sent_until.max(now - MOST_S);
        let aside = self.received();
        let level = aside.and_then(|(beacon, _)| self.refresh(beacon, now));
        let full_scale = self.config.full_scale_dbm - self.gain_db;
        let amplitude = level.map_or(0.0, |dbm| 127.5 * 10.0_f64.powf((dbm - full_scale) / 20.0));
        let step = aside.map_or(0.0, |(_, hz)| hz / rate);
        let count = ((now - begin) * rate).floor().max(0.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below 4e6")]
        let count = count as u32;
        let mut bytes = Vec::new();
        for n in 0..count {
            let on = sends(begin + f64::from(n) / rate);
            let (sin, cos) = (TAU * self.phase).sin_cos();
            self.phase = (self.phase + step).fract();
            let carrier = if on { amplitude } else { 0.0 };
            for part in [cos, sin] {
                let noise: f64 = self.random.sample(StandardNormal);
                let value = 127.5 + carrier * part + self.config.noise_steps * noise;
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "from 0 to 255"
                )]
                bytes.push(value.round().clamp(0.0, 255.0) as u8);
            }
        }
        self.sent_until = begin + f64::from(count) / rate;
        bytes
    }
}

impl<S: ByteStream> Emulator for EmulatedRtlTcp<S> {
    fn serve(&mut self) -> io::Result<()> {
        let now = self.clock.now();
        let mut bytes = [0; 512];
        let count = self.stream.receive(&mut bytes)?;
        let connections = self.stream.connections();
        if connections != self.met {
            self.met = connections;
            self.begun.clear();
            // An R820T with its 29 gains.
            self.stream.send(&RtlTcpHeader { tuner: 5, gains: 29 }.encode())?;
            self.sent_until = now;
        }
        self.obey(bytes.get(..count).unwrap_or_default());
        if connections == 0 {
            return Ok(());
        }
        let samples = self.samples(now);
        match self.stream.send(&samples) {
            // Nobody is there any more; another may come.
            Err(error) if error.kind() == io::ErrorKind::NotConnected => Ok(()),
            other => other,
        }
    }
}
