//! The power and the pulses of beacons from an RTL-SDR behind rtl_tcp.

use foxhunt_core::{BeaconId, Clock, Radio, parameter::FieldError};
use foxhunt_signal::{
    Complex32,
    detector::{Detection, Detector, DetectorConfig, DetectorError},
    samples::SampleFormat,
};
use foxhunt_wire::{ByteStream, receivers::NarrowBand};

use super::{
    PulseConfig, RtlTcpConfig, RtlTcpRadioError, RtlTcpSamples, SampleLosses,
    config::SEARCH_EVERY_S,
};
use crate::Finding;

/// Most chunks that one poll takes, so that it ends.
const CHUNKS: usize = 256;

/// Pauses after which waiting ends, whatever the clock shows.
const PAUSES: u32 = 1_000_000;

/// An RTL-SDR behind rtl_tcp, as a receiver of beacons that send by themselves.
///
/// A question tunes to its beacon and lets the receiver settle. Of a beacon that sends all the time
/// it gathers a window of power, of which a high quantile is the level. Of one that
/// [pulses](RtlTcpConfig::pulse) it waits for the next pulse, whose level is its energy over its
/// length; what comes in besides is left out, and where no pulse comes there is no level. Beacons
/// that fit into one band are watched all the time, so that the noise is known.
///
/// It sets rate and gain when it is connected, and again after a connection was lost.
#[derive(Debug)]
pub struct RtlTcpRadio<S, C> {
    config: RtlTcpConfig,
    samples: RtlTcpSamples<S, C>,
    clock: C,
    tuned: Option<u32>,
    question: Option<Question>,
    watch: Option<PulseWatch>,
    clipping: Clipping,
    /// The level in dBm, and when it was measured.
    answer: Option<(f64, Option<f64>)>,
    measured_at: Option<f64>,
    bytes: Vec<u8>,
}

/// A request for a beacon's level.
#[derive(Debug)]
struct Question {
    frequency_hz: u32,
    /// First sample that counts.
    from: u64,
    /// The power of a beacon that sends all the time.
    gather: Option<Gather>,
}

/// Number of bytes at an end of the scale, and of all.
#[derive(Clone, Copy, Debug, Default)]
struct Clipping {
    clipped: usize,
    taken: usize,
}

impl Clipping {
    fn take(&mut self, bytes: &[u8]) {
        self.clipped += bytes.iter().filter(|byte| matches!(byte, 0 | 255)).count();
        self.taken += bytes.len();
    }

    /// Returns true if the receiver is overdriven: more than a hundredth of the bytes are clipped.
    fn is_overdriven(&self) -> bool {
        self.clipped.saturating_mul(100) > self.taken
    }
}

impl<S: ByteStream, C: Clock + Clone> RtlTcpRadio<S, C> {
    /// A receiver behind a stream.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names what is wrong in `config`.
    pub fn new(config: RtlTcpConfig, stream: S, clock: C) -> Result<Self, FieldError> {
        config.check()?;
        Ok(Self {
            samples: RtlTcpSamples::new(config.tuning(), stream, clock.clone())?,
            config,
            clock,
            tuned: None,
            question: None,
            watch: None,
            clipping: Clipping::default(),
            answer: None,
            measured_at: None,
            bytes: Vec::new(),
        })
    }
}

impl<S: ByteStream, C: Clock> RtlTcpRadio<S, C> {
    /// Returns the losses of its samples until now.
    #[must_use]
    pub fn losses(&self) -> SampleLosses {
        self.samples.losses()
    }

    /// The power in dBm that a pulse of a beacon must have to be found at present; `None` where
    /// that is not known, or beacons send all the time.
    #[must_use]
    pub fn pulse_floor_dbm(&self, beacon: BeaconId) -> Option<f64> {
        let frequency = *self.config.frequencies_hz.get(usize::from(beacon.0))?;
        self.watch.as_ref()?.floor_dbm(frequency)
    }

    /// Takes what has come, and gives an answer where there is one.
    fn serve(&mut self) -> Result<(), RtlTcpRadioError> {
        let mut bytes = std::mem::take(&mut self.bytes);
        let mut served = Ok(());
        for _ in 0..CHUNKS {
            match self.samples.poll(&mut bytes) {
                Ok(Some(first)) => served = self.take(first, &bytes),
                Ok(None) => break,
                Err(error) => served = Err(error),
            }
            if served.is_err() {
                break;
            }
        }
        self.bytes = bytes;
        served
    }

    fn take(&mut self, first: u64, bytes: &[u8]) -> Result<(), RtlTcpRadioError> {
        self.clipping.take(bytes);
        if let Some(watch) = &mut self.watch {
            watch.push(first, bytes).map_err(RtlTcpRadioError::Pulses)?;
            let next = first.saturating_add(u64::try_from(bytes.len() / 2).unwrap_or(0));
            self.look_for_pulse(next);
            return Ok(());
        }
        let Some(question) = &mut self.question else { return Ok(()) };
        let early = usize::try_from(question.from.saturating_sub(first)).unwrap_or(usize::MAX);
        let bytes = bytes.get(early.saturating_mul(2)..).unwrap_or_default();
        if let Some(gather) = &mut question.gather
            && gather.push(bytes)
        {
            let level = gather.level_dbfs(self.config.quantile) + self.config.full_scale_dbm;
            let counts = self.config.floor_dbm.is_none_or(|floor| level >= floor);
            self.answer = counts.then_some((level, None));
            self.question = None;
        }
        Ok(())
    }

    /// Answers with a pulse that was found, or gives the question up when one would be known.
    fn look_for_pulse(&mut self, next: u64) {
        let (Some(question), Some(watch), Some(pulse)) =
            (&self.question, &mut self.watch, self.config.pulse)
        else {
            return;
        };
        let frequency = f64::from(question.frequency_hz);
        let apart = |hz: f64, of: f64| (hz - of).abs();
        let others = &self.config.frequencies_hz;
        // Tags that are close together: the one that is nearest.
        let of = |hz: f64| {
            let own = apart(hz, frequency);
            own <= pulse.search_hz && others.iter().all(|of| apart(hz, f64::from(*of)) >= own)
        };
        let mut answer = watch.take(question.from, of);
        let over = count((pulse.wait_s() + pulse.latency_s()) * rate(&self.config));
        let is_over = next >= question.from.saturating_add(over);
        let alone = self.config.common_center_hz().is_none();
        if answer.is_none() && is_over && alone {
            watch.finish();
            answer = watch.take(question.from, of);
        }
        if answer.is_some() || (is_over && (alone || watch.is_ready())) {
            self.answer = answer.map(|(level, index)| (level, self.samples.time_of(index)));
            self.question = None;
        }
        if alone && self.question.is_none() {
            self.watch = None;
            self.tuned = None;
        }
    }

    /// Tunes to a frequency, and begins to measure.
    fn tune(&mut self, frequency_hz: u32) -> Result<(), RtlTcpRadioError> {
        let common = self.config.common_center_hz();
        let center = common.unwrap_or(frequency_hz.saturating_sub(self.config.beside_hz));
        let now = self.clock.now();
        let from = self.samples.index_at(now + self.config.settling_s);
        let tunes = self.tuned != Some(center);
        if tunes {
            self.samples.tune(center)?;
            self.tuned = Some(center);
        }
        self.clipping = Clipping::default();
        let mut gather = None;
        match self.config.pulse {
            None => gather = Gather::new(&self.config),
            Some(pulse) if tunes || self.watch.is_none() => {
                let all = &self.config.frequencies_hz;
                let range = all.iter().min().copied().zip(all.iter().max().copied());
                let watched = match (common, range) {
                    (Some(_), Some((low, high))) => [low, high],
                    _ => [frequency_hz; 2],
                };
                let watch = PulseWatch::new(&self.config, pulse, center, watched, from);
                self.watch = Some(watch.map_err(RtlTcpRadioError::Pulses)?);
            }
            Some(_) => {}
        }
        self.question = Some(Question { frequency_hz, from, gather });
        Ok(())
    }

    /// Looks at the receiver: what its tuner is, and how strong each beacon is now. `pause` is
    /// called while it waits, and has to let a little time pass.
    pub fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        let mut findings = Vec::new();
        for beacon in (0..).map(BeaconId).take(self.config.frequencies_hz.len()) {
            let subject = format!("beacon {}", beacon.0);
            match self.look(beacon, pause) {
                Err(error) => {
                    let remedy =
                        "start rtl_tcp, check its address, and that it has no other client";
                    findings.push(Finding::bad("rtl_tcp", error, remedy));
                    return findings;
                }
                Ok(level) if self.clipping.is_overdriven() => {
                    let level =
                        level.map_or("too strong".into(), |level| format!("{level:.1} dBm"));
                    let remedy = "the receiver is overdriven: lower gain_db, and measure \
                                  full_scale_dbm again";
                    findings.push(Finding::bad(&subject, format_args!("now {level}"), remedy));
                }
                Ok(Some(level)) => {
                    let floor = self.pulse_floor_dbm(beacon);
                    let found = floor.map_or_else(String::new, |floor| {
                        format!("; pulses above {floor:.1} dBm are found")
                    });
                    let text = format!("now {level:.1} dBm{found}");
                    findings.push(Finding::good(&subject, text));
                }
                Ok(None) if self.config.pulse.is_some() => findings.push(Finding::bad(
                    &subject,
                    "no pulse in an interval",
                    "switch the tag on, go closer, and check its frequency, interval_s, width_s \
                     and correction_ppm: foxhunt listen shows what is on air",
                )),
                Ok(None) => findings.push(Finding::bad(
                    &subject,
                    "now below floor_dbm",
                    "switch the beacon on, go closer, and check its frequency and correction_ppm",
                )),
            }
        }
        let tuner = self.samples.header().map(|header| {
            Finding::good("rtl_tcp", format_args!("tuner {}, {} gains", header.tuner, header.gains))
        });
        findings.splice(0..0, tuner);
        findings
    }

    /// The power of a beacon, if it is received.
    fn look(
        &mut self,
        beacon: BeaconId,
        pause: &mut dyn FnMut(),
    ) -> Result<Option<f64>, RtlTcpRadioError> {
        self.request(beacon)?;
        for _ in 0..PAUSES {
            let level = self.poll()?;
            if level.is_some() || self.question.is_none() {
                return Ok(level);
            }
            pause();
        }
        Ok(None)
    }
}

impl<S: ByteStream, C: Clock> Radio for RtlTcpRadio<S, C> {
    type Error = RtlTcpRadioError;

    /// # Errors
    ///
    /// [`RtlTcpRadioError::Beacon`] if there is no frequency of it; an older question stays then.
    /// Any error of the connection.
    fn request(&mut self, beacon: BeaconId) -> Result<(), RtlTcpRadioError> {
        let frequencies = &self.config.frequencies_hz;
        let missing = RtlTcpRadioError::Beacon { beacon: beacon.0, beacons: frequencies.len() };
        let frequency = *frequencies.get(usize::from(beacon.0)).ok_or(missing)?;
        // What has come until now was received before the question.
        self.question = None;
        let before = self.serve();
        self.answer = None;
        before?;
        self.tune(frequency)
    }

    fn poll(&mut self) -> Result<Option<f64>, RtlTcpRadioError> {
        let served = self.serve();
        match self.answer.take() {
            Some((level, measured_at)) => {
                self.measured_at = measured_at;
                Ok(Some(level))
            }
            None => served.map(|()| None),
        }
    }

    fn measured_at(&self) -> Option<f64> {
        self.measured_at
    }
}

/// Gathers the powers of a window.
#[derive(Clone, Debug)]
struct Gather {
    band: NarrowBand,
    /// In the order in which they came; as many as are wanted at most.
    powers: Vec<f64>,
    wanted: usize,
}

impl Gather {
    /// Creates an empty one; `None` if the band is invalid.
    fn new(config: &RtlTcpConfig) -> Option<Self> {
        let rate = f64::from(config.sample_rate_hz);
        let band = NarrowBand::new(rate, f64::from(config.beside_hz), config.bandwidth_hz)?;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most 10 s of 10 MS/s"
        )]
        let count = (config.window_s * rate).clamp(0.0, 1e8) as u32;
        let wanted = usize::try_from(count / band.block()).ok()?.max(1);
        Some(Self { band, powers: Vec::new(), wanted })
    }

    /// Takes what has come; returns true if that is enough.
    fn push(&mut self, bytes: &[u8]) -> bool {
        let powers = &mut self.powers;
        let wanted = self.wanted;
        self.band.push(bytes, |power| {
            if powers.len() < wanted {
                powers.push(power);
            }
        });
        powers.len() >= wanted
    }

    /// The power in dB over full scale below which a share of the window lies.
    fn level_dbfs(&self, share: f64) -> f64 {
        let mut sorted = self.powers.clone();
        sorted.sort_by(f64::total_cmp);
        let last = u32::try_from(sorted.len().saturating_sub(1)).unwrap_or(u32::MAX);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to last")]
        let index = (f64::from(last) * share).round() as usize;
        // Zeros alone: less than any that a byte holds.
        sorted.get(index).map_or(-200.0, |power| 10.0 * power.max(1e-20).log10())
    }
}

/// The pulses in the samples of a receiver that is tuned to a frequency.
#[derive(Debug)]
struct PulseWatch {
    detector: Detector,
    pulse: PulseConfig,
    rate_hz: f64,
    /// Samples before this index are left out: the receiver was not there yet.
    from: u64,
    samples: Vec<Complex32>,
    found: Vec<Detection>,
}

impl PulseWatch {
    /// Watches these frequencies, from a sample on.
    fn new(
        config: &RtlTcpConfig,
        pulse: PulseConfig,
        center_hz: u32,
        watched_hz: [u32; 2],
        from: u64,
    ) -> Result<Self, DetectorError> {
        let rate_hz = f64::from(config.sample_rate_hz);
        let [lowest, highest] = watched_hz.map(f64::from);
        let mut detector = DetectorConfig::new(rate_hz);
        detector.center_hz = Some(f64::from(center_hz));
        detector.band_hz = Some([lowest - pulse.search_hz, highest + pulse.search_hz]);
        detector.widths_s = vec![pulse.width_s];
        detector.false_alarms_per_hour = pulse.false_alarms_per_hour;
        detector.least_noise = SampleFormat::Cu8.rounding_noise();
        detector.full_scale_dbm = config.full_scale_dbm;
        detector.search_every_s = Some(SEARCH_EVERY_S);
        let detector = Detector::new(detector)?;
        Ok(Self { detector, pulse, rate_hz, from, samples: Vec::new(), found: Vec::new() })
    }

    /// Takes bytes, the first sample of which has an index.
    fn push(&mut self, first: u64, bytes: &[u8]) -> Result<(), DetectorError> {
        let early = usize::try_from(self.from.saturating_sub(first)).unwrap_or(usize::MAX);
        let bytes = bytes.get(early.saturating_mul(2)..).unwrap_or_default();
        if bytes.is_empty() {
            return Ok(());
        }
        self.samples.clear();
        SampleFormat::Cu8.decode(bytes, &mut self.samples);
        self.detector.push(first.max(self.from), &self.samples, &mut self.found)
    }

    /// Searches the remaining samples: nothing comes that belongs to them.
    fn finish(&mut self) {
        self.detector.finish(&mut self.found);
    }

    /// Returns true if the noise is known, so that pulses are found soon after they came.
    fn is_ready(&self) -> bool {
        self.detector.searched_s() > 0.0
    }

    /// The power in dBm that a pulse at a frequency must have to be found, once that is known.
    fn floor_dbm(&self, frequency_hz: u32) -> Option<f64> {
        self.detector.floor_dbm(f64::from(frequency_hz), self.pulse.width_s)
    }

    /// The first pulse that begins at a sample or later and is `of` the tag that is sought: its
    /// level in dBm, and the sample in its middle. All that were found are given up.
    fn take(&mut self, from: u64, of: impl Fn(f64) -> bool) -> Option<(f64, f64)> {
        #[expect(clippy::cast_precision_loss, reason = "below 2^52")]
        let from = from as f64;
        let pulses = self.found.drain(..).map(|detection| detection.pulse);
        let mut pulses = pulses.filter(|pulse| {
            // Its ends are known to a small part of its length.
            let begin = pulse.time_s - 0.5 * pulse.width_s + 0.1 * self.pulse.width_s;
            begin * self.rate_hz >= from && of(pulse.frequency_hz)
        });
        let pulse = pulses.next()?;
        Some((pulse.power_dbm, pulse.time_s * self.rate_hz))
    }
}

fn rate(config: &RtlTcpConfig) -> f64 {
    f64::from(config.sample_rate_hz)
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it saturates")]
fn count(samples: f64) -> u64 {
    samples.round() as u64
}
