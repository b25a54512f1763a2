//! Receivers of a world whose transmitters send by themselves: an RTL-SDR, and servers as rtl_tcp
//! and a `KrakenSDR` have them.

mod servers;

pub use servers::{EmulatedKraken, EmulatedKrakenConfig, EmulatedRtlTcp};

use std::f64::consts::TAU;

use foxhunt_core::{
    BeaconId, Clock,
    parameter::{FieldError, finite, in_range, not_negative, positive, require},
};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use crate::{
    PulseTrain, SimClock, SimError, World,
    devices::OnBoard,
    truth::{Port, Truth, beacon_of},
};

/// Time from one look at the power of a beacon that sends all the time to the next, in seconds.
const REFRESH_S: f64 = 0.01;

/// The most that is sampled at once, in seconds; anything older is lost.
const MOST_S: f64 = 0.2;

/// A bit of what a beacon without pulses sends, in seconds.
const BIT_S: f64 = 0.001;

/// The keying of a beacon: 16 bits of a millisecond each, first to last, then silence.
const KEY: u16 = 0b1011_0010_1110_1001;
const PERIOD_S: f64 = 0.05;

/// The settings of an emulated RTL-SDR, and the transmitters besides the beacons.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EmulatedRtlTcpConfig {
    /// The power of a tone at full scale with a gain of 0, in dBm.
    pub full_scale_dbm: f64,
    /// σ of the noise of each I and Q, in steps of a byte.
    pub noise_steps: f64,
    /// The seed of the noise.
    pub seed: u64,
    /// σ of how far each beacon's oscillator is from its frequency, in Hz; the same at every
    /// receiver.
    pub carrier_sigma_hz: f64,
    /// The drift of the beacons' oscillators, in Hz per second.
    pub drift_hz_per_s: f64,
    /// The error of the receiver's own oscillator, in parts per million: its client has to correct
    /// it.
    pub oscillator_ppm: f64,
    /// True if its antenna is the drone's, which may have a direction; otherwise it has none.
    pub directional: bool,
    /// Other transmitters.
    pub interferers: Vec<InterfererConfig>,
}

/// A transmitter that is no beacon: a carrier, all the time or now and then.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InterfererConfig {
    /// Frequency of the carrier, in Hz.
    pub frequency_hz: f64,
    /// Power of the carrier at every antenna, in dBm.
    pub level_dbm: f64,
    /// Duration of a transmission, in seconds; if absent, it sends all the time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub on_s: Option<f64>,
    /// Time from one beginning to the next, in seconds; with `on_s`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub every_s: Option<f64>,
}

/// 0 dBm, 0.7 steps; oscillators without an error, the drone's antenna, no interferers.
impl Default for EmulatedRtlTcpConfig {
    fn default() -> Self {
        Self {
            full_scale_dbm: 0.0,
            noise_steps: 0.7,
            seed: 1,
            carrier_sigma_hz: 0.0,
            drift_hz_per_s: 0.0,
            oscillator_ppm: 0.0,
            directional: true,
            interferers: Vec::new(),
        }
    }
}

impl EmulatedRtlTcpConfig {
    fn check(&self) -> Result<(), FieldError> {
        in_range("noise_steps", self.noise_steps, 0.0..=50.0, "from 0 to 50")?;
        finite("full_scale_dbm", self.full_scale_dbm)?;
        not_negative("carrier_sigma_hz", self.carrier_sigma_hz)?;
        finite("drift_hz_per_s", self.drift_hz_per_s)?;
        in_range("oscillator_ppm", self.oscillator_ppm, -1e3..=1e3, "from -1000 to 1000")?;
        for (i, interferer) in self.interferers.iter().enumerate() {
            interferer.check().map_err(|error| error.within(format_args!("interferers[{i}]")))?;
        }
        Ok(())
    }
}

impl InterfererConfig {
    fn check(&self) -> Result<(), FieldError> {
        positive("frequency_hz", self.frequency_hz)?;
        finite("level_dbm", self.level_dbm)?;
        match (self.on_s, self.every_s) {
            (None, None) => Ok(()),
            (Some(on), Some(every)) => {
                positive("on_s", on)?;
                // Not shorter than a block of samples is worth looking at.
                let apart = every.is_finite() && every > on && every >= 1e-3;
                require(apart, "every_s", every, "above on_s, and 0.001 at least")?;
                Ok(())
            }
            (Some(_), None) => Err(FieldError::new("every_s", "missing", "given with on_s")),
            (None, Some(_)) => Err(FieldError::new("on_s", "missing", "given with every_s")),
        }
    }
}

/// An RTL-SDR under the antenna of a simulated drone: its tuning, and the samples that it takes.
///
/// All that sends in the band that it is tuned to is in the samples: beacons with
/// [pulses](crate::BeaconConfig::pulses) as pulses of a carrier, each with the power of its
/// beginning; other beacons keyed on and off, 16 bits of 1 ms in every 50 ms; interferers; noise.
#[derive(Debug)]
pub struct EmulatedDongle {
    on_board: OnBoard,
    clock: SimClock,
    config: EmulatedRtlTcpConfig,
    random: Xoshiro256PlusPlus,
    rate_hz: u32,
    middle_hz: u32,
    gain_db: f64,
    correction_ppm: i32,
    /// The samples until then were taken.
    until: f64,
    emissions: Vec<Emission>,
    played: Vec<PlayedPulse>,
}

/// A pulse of a beacon that an emulated receiver has played.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct PlayedPulse {
    /// The beacon that sent it.
    pub beacon: BeaconId,
    /// Time of its middle, in seconds of the world's time.
    pub time_s: f64,
    /// Carrier frequency as the receiver has it, with the error of its own oscillator, in Hz.
    pub frequency_hz: f64,
    /// Duration of the pulse, in seconds.
    pub width_s: f64,
    /// Power of the pulse, in dBm.
    pub power_dbm: f64,
    /// Energy of the pulse over the power density of the receiver's noise, rounding included, in
    /// dB.
    pub snr_db: f64,
}

/// One transmitter as it comes in.
#[derive(Clone, Copy, Debug)]
struct Emission {
    sender: Sender,
    /// Frequency of its oscillator at the time 0, in Hz.
    frequency_hz: f64,
    drift_hz_per_s: f64,
    /// Phase of its carrier, in turns.
    phase: f64,
    /// The time until which the power that was looked up last holds, and that power in dBm.
    power: (f64, Option<f64>),
}

#[derive(Clone, Copy, Debug)]
enum Sender {
    Beacon(BeaconId, Option<PulseTrain>),
    Interferer(InterfererConfig),
}

/// A stretch of time, and the power in dBm in it.
type Stretch = (f64, f64, f64);

impl EmulatedDongle {
    /// A receiver at 250 kS/s, tuned to the first beacon, with a gain of 0.
    ///
    /// # Errors
    ///
    /// [`SimError::Drone`] if there is no such drone; [`SimError::Field`] names what is out of
    /// range in `config`.
    pub fn new(
        world: &World,
        drone: usize,
        config: EmulatedRtlTcpConfig,
    ) -> Result<Self, SimError> {
        config.check()?;
        let on_board = world.on_board(drone)?;
        let frequencies: Vec<f64> =
            (0..).map_while(|id| Some(1e6 * world.frequency_mhz(BeaconId(id))?)).collect();
        let beacons = (0..).map(BeaconId).zip(&frequencies).map(|(id, hz)| {
            // Its oscillator is the same for every receiver.
            let mut draw = Xoshiro256PlusPlus::seed_from_u64(hz.to_bits());
            let off: f64 = draw.sample(StandardNormal);
            Emission {
                sender: Sender::Beacon(id, world.pulses(id)),
                frequency_hz: hz + config.carrier_sigma_hz * off,
                drift_hz_per_s: config.drift_hz_per_s,
                phase: 0.0,
                power: (f64::NEG_INFINITY, None),
            }
        });
        let interferers = config.interferers.iter().map(|interferer| Emission {
            sender: Sender::Interferer(*interferer),
            frequency_hz: interferer.frequency_hz,
            drift_hz_per_s: 0.0,
            phase: 0.0,
            power: (f64::NEG_INFINITY, None),
        });
        Ok(Self {
            emissions: beacons.chain(interferers).collect(),
            on_board,
            clock: world.clock(),
            random: Xoshiro256PlusPlus::seed_from_u64(config.seed),
            middle_hz: frequencies.first().copied().map_or(100_000_000, whole),
            config,
            rate_hz: 250_000,
            gain_db: 0.0,
            correction_ppm: 0,
            until: world.time(),
            played: Vec::new(),
        })
    }

    /// Tunes it to a frequency, in Hz.
    pub fn tune(&mut self, middle_hz: u32) {
        self.middle_hz = middle_hz;
    }

    /// Sets the number of samples per second; a rate of 0 or above 4 MHz is ignored.
    pub fn set_rate(&mut self, rate_hz: u32) {
        if (1..=4_000_000).contains(&rate_hz) {
            self.rate_hz = rate_hz;
        }
    }

    /// Sets its gain, in dB.
    pub fn set_gain(&mut self, gain_db: f64) {
        self.gain_db = gain_db;
    }

    /// Sets what is taken for the error of its oscillator, in parts per million.
    pub fn set_correction(&mut self, correction_ppm: i32) {
        self.correction_ppm = correction_ppm;
    }

    /// Discards the time before now: sampling goes on from the present.
    pub fn restart(&mut self) {
        self.until = self.clock.now();
    }

    /// The pulses that have begun in samples since the last call.
    pub fn played(&mut self) -> Vec<PlayedPulse> {
        std::mem::take(&mut self.played)
    }

    /// The samples from the last ones to the world's present time, I and Q, a byte each, 127.5 for
    /// zero. Of more than 0.2 s the first are lost.
    pub fn take(&mut self) -> Vec<u8> {
        let now = self.clock.now();
        let rate = f64::from(self.rate_hz);
        let begin = self.until.max(now - MOST_S);
        // Sums of steps are forgiven a nanosecond.
        let samples = ((now - begin) * rate + 1e-9 * rate).floor().max(0.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below 1e6")]
        let count = samples as usize;
        let mut baseband = vec![[0.0; 2]; count];
        let end = begin + samples / rate;
        for index in 0..self.emissions.len() {
            self.add(index, begin, end, &mut baseband);
        }
        self.until = end;
        let mut bytes = Vec::with_capacity(2 * count);
        for sample in baseband {
            for part in sample {
                let noise: f64 = self.random.sample(StandardNormal);
                let value = 127.5 + part + self.config.noise_steps * noise;
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "from 0 to 255"
                )]
                bytes.push(value.round().clamp(0.0, 255.0) as u8);
            }
        }
        bytes
    }

    /// Adds what comes in of one transmitter, in steps of a byte.
    fn add(&mut self, index: usize, begin: f64, end: f64, baseband: &mut [[f64; 2]]) {
        let rate = f64::from(self.rate_hz);
        let middle = f64::from(self.middle_hz);
        let Some(emission) = self.emissions.get(index).copied() else { return };
        let off = (self.config.oscillator_ppm - f64::from(self.correction_ppm)) * 1e-6;
        let sent = emission.frequency_hz + emission.drift_hz_per_s * begin;
        let aside = sent - middle * (1.0 + off);
        let received = aside.abs() < rate / 2.0;
        let stretches = if received { self.stretches(index, begin, end, aside) } else { vec![] };
        let step = aside / rate;
        for (from, to, dbm) in stretches {
            let full_scale = self.config.full_scale_dbm - self.gain_db;
            let amplitude = 127.5 * 10.0_f64.powf((dbm - full_scale) / 20.0);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
            let place = |time: f64| ((time - begin) * rate).ceil().max(0.0) as usize;
            let from = place(from);
            let to = place(to).min(baseband.len());
            for (n, sample) in baseband.iter_mut().enumerate().take(to).skip(from) {
                #[expect(clippy::cast_precision_loss, reason = "below 1e6")]
                let (sin, cos) = (TAU * (emission.phase + step * n as f64).fract()).sin_cos();
                sample[0] += amplitude * cos;
                sample[1] += amplitude * sin;
            }
        }
        #[expect(clippy::cast_precision_loss, reason = "below 1e6")]
        let turns = step * baseband.len() as f64;
        if let Some(emission) = self.emissions.get_mut(index) {
            emission.phase = (emission.phase + turns).fract();
        }
    }

    /// The stretches of time in which a transmitter sends between two times.
    fn stretches(&mut self, index: usize, begin: f64, end: f64, aside_hz: f64) -> Vec<Stretch> {
        let Some(emission) = self.emissions.get(index).copied() else { return Vec::new() };
        let mut stretches = Vec::new();
        match emission.sender {
            Sender::Interferer(InterfererConfig { level_dbm, on_s, every_s, .. }) => {
                let Some((on, every)) = on_s.zip(every_s) else {
                    return vec![(begin, end, level_dbm)];
                };
                let mut from = (begin / every).floor() * every;
                while from < end {
                    stretches.push((from, from + on, level_dbm));
                    from += every;
                }
            }
            Sender::Beacon(id, Some(train)) => {
                let mut time = begin;
                loop {
                    let to = train.end_after(time);
                    let from = to - train.pulse_s;
                    if from >= end {
                        break;
                    }
                    let (of, known) = emission.power;
                    let power = if of.to_bits() == to.to_bits() { known } else { self.power(id) };
                    if of.to_bits() != to.to_bits() {
                        self.keep(index, to, power);
                        self.note(id, train, to, aside_hz, power);
                    }
                    stretches.extend(power.map(|dbm| (from, to, dbm)));
                    time = to;
                }
            }
            Sender::Beacon(id, None) => {
                let (until, known) = emission.power;
                let fresh = begin < until;
                let power = if fresh { known } else { self.power(id) };
                if !fresh {
                    self.keep(index, begin + REFRESH_S, power);
                }
                let Some(dbm) = power else { return stretches };
                let mut from = (begin / BIT_S).floor() * BIT_S;
                while from < end {
                    if sends(from + BIT_S / 2.0) {
                        stretches.push((from, from + BIT_S, dbm));
                    }
                    from += BIT_S;
                }
            }
        }
        stretches
    }

    /// The power that comes in of a beacon now, in dBm.
    fn power(&self, beacon: BeaconId) -> Option<f64> {
        self.on_board.with_truth(|truth, drone| {
            let Truth { time, channel, beacons, drones, .. } = truth;
            let from = beacon_of(beacons, beacon).ok()?;
            let port =
                if self.config.directional { Port::Directional } else { Port::Omnidirectional };
            drones.get_mut(drone)?.incoming(channel, beacon, from, port, *time)
        })
    }

    fn keep(&mut self, index: usize, until: f64, power: Option<f64>) {
        if let Some(emission) = self.emissions.get_mut(index) {
            emission.power = (until, power);
        }
    }

    fn note(
        &mut self,
        beacon: BeaconId,
        train: PulseTrain,
        end: f64,
        aside_hz: f64,
        power: Option<f64>,
    ) {
        let Some(power_dbm) = power else { return };
        let full_scale = self.config.full_scale_dbm - self.gain_db;
        // Rounding adds a twelfth of a step's square to each of I and Q.
        let steps = self.config.noise_steps.powi(2) + 1.0 / 12.0;
        let noise = 2.0 * steps / 127.5_f64.powi(2) / f64::from(self.rate_hz);
        let energy = 10.0_f64.powf((power_dbm - full_scale) / 10.0) * train.pulse_s;
        self.played.push(PlayedPulse {
            beacon,
            time_s: end - train.pulse_s / 2.0,
            frequency_hz: f64::from(self.middle_hz) + aside_hz,
            width_s: train.pulse_s,
            power_dbm,
            snr_db: 10.0 * (energy / noise).log10(),
        });
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it saturates")]
fn whole(hz: f64) -> u32 {
    hz.round() as u32
}

/// Returns true if the beacon sends at a time.
fn sends(time: f64) -> bool {
    let bit = ((time / PERIOD_S).fract() * PERIOD_S / BIT_S).floor();
    if !(0.0..16.0).contains(&bit) {
        return false;
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 15")]
    let bit = bit as u32;
    KEY << bit & 0x8000 != 0
}
