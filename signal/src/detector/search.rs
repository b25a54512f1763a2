use std::ops::Range;

use rustfft::num_complex::Complex32;

use super::{
    Detection, DetectorConfig, DetectorError,
    bank::{Candidate, Stretch, Window},
    channeliser::{Channeliser, float},
    noise::Noise,
    refine::{Peak, View, beside, over_burst},
    resolve::{Extent, SMEAR},
    threshold::FalseAlarms,
};
use crate::Pulse;

/// What is screened at a grid's points, over the threshold: between them a peak has lost at most
/// 2.1 dB.
const SCREENED: f64 = 0.55;
/// How much of a channel is kept for reference cells, in windows of the widest.
const KEPT: usize = 15;
/// How close to the end a candidate may begin, in windows of the widest, until more samples come.
const OPEN: u64 = 3;
/// How many other channels are looked at for what is on air at a pulse's time.
const OTHER_CHANNELS: usize = 16;
/// The bias of the highest energy near a pulse: 1 of the noise in the sum, and about 1 from taking
/// the highest over time and frequency.
const BIAS: f64 = 2.0;

/// Finds pulses in a stream of complex samples, in bounded memory.
///
/// Samples are searched in blocks of about a second, so a pulse is given that much later. The first
/// blocks have a higher threshold, as the noise is less known.
///
/// ```
/// use foxhunt_signal::detector::{Detector, DetectorConfig};
///
/// let mut config = DetectorConfig::new(250e3);
/// config.center_hz = Some(150.1e6);
/// let mut detector = Detector::new(config)?;
/// let mut found = Vec::new();
/// // For each chunk of samples: detector.push(first_index, &samples, &mut found)?;
/// detector.finish(&mut found);
/// assert!(found.is_empty());
/// # Ok::<(), foxhunt_signal::detector::DetectorError>(())
/// ```
#[derive(Debug)]
pub struct Detector {
    config: DetectorConfig,
    channeliser: Channeliser,
    centers_hz: Vec<f64>,
    /// Of each channel what is its own, over its rate.
    ranges: Vec<[f64; 2]>,
    windows: Vec<Window>,
    noise: Noise,
    alarms: FalseAlarms,
    channels: Vec<Vec<Complex32>>,
    /// The index of the channels' first kept sample, from the last gap.
    origin: u64,
    /// From where the noise is not measured yet, from the last gap.
    measured: u64,
    /// From where nothing was searched yet, from the last gap.
    looked: u64,
    /// The input's index of the first sample after the last gap, and of the next one.
    segment: u64,
    expected: Option<u64>,
    /// Samples since a search could last begin.
    taken: usize,
    pending: Vec<Candidate>,
    /// Signals given or refused that may hide what is still open.
    settled: Vec<Extent>,
    /// Samples of a channel that were searched.
    searched: u64,
}

/// What becomes of a candidate.
enum Verdict {
    Nothing,
    /// A signal that is no pulse, which hides weaker ones as a pulse does.
    Refused(Extent),
    Pulse(Extent, Detection),
}

impl Detector {
    /// A detector of these settings.
    ///
    /// # Errors
    ///
    /// [`DetectorError::Setting`] if one is out of its range.
    pub fn new(config: DetectorConfig) -> Result<Self, DetectorError> {
        config.check()?;
        let band = config.band_about_center();
        let (narrow, _) = config.narrow_and_wide();
        // Fifteen samples in the narrowest window, and not less than fine steps in time need.
        let spacing_hz = (10.0 / narrow).max(4e3);
        let channeliser = Channeliser::new(config.rate_hz, spacing_hz, band);
        let centers_hz = channeliser.centers_hz();
        let (rate, half) = (channeliser.channel_rate_hz(), channeliser.spacing_hz() / 2.0);
        let range = |center: &f64| {
            [band[0].max(center - half), band[1].min(center + half)].map(|f| (f - center) / rate)
        };
        let ranges: Vec<_> = centers_hz.iter().map(range).collect();
        let mut lengths: Vec<usize> =
            config.widths_s.iter().map(|width| samples(width * rate).max(1)).collect();
        lengths.sort_unstable();
        lengths.dedup();
        let windows = lengths.iter().map(|length| Window::new(*length, &ranges)).collect();
        // White noise falls on all channels' rates alike.
        let least = config.least_noise / float(channeliser.decimation());
        let noise = Noise::new(lengths[lengths.len() / 2].max(8), &ranges, least);
        let alarms = FalseAlarms::new(band[1] - band[0], lengths);
        let channels = vec![Vec::new(); centers_hz.len()];
        Ok(Self {
            config,
            channeliser,
            centers_hz,
            ranges,
            windows,
            noise,
            alarms,
            channels,
            origin: 0,
            measured: 0,
            looked: 0,
            segment: 0,
            taken: 0,
            expected: None,
            pending: Vec::new(),
            settled: Vec::new(),
            searched: 0,
        })
    }

    /// How many seconds were searched; gaps do not count.
    #[must_use]
    pub fn searched_s(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "below 2^52")]
        let searched = self.searched as f64;
        searched / self.channeliser.channel_rate_hz()
    }

    /// The threshold of a pulse's energy over the noise's power density now, in dB.
    #[must_use]
    pub fn threshold_db(&self) -> f64 {
        10.0 * self.threshold().log10()
    }

    fn threshold(&self) -> f64 {
        let rate_hz = self.config.false_alarms_per_hour / 3600.0;
        self.alarms.threshold(rate_hz, self.noise.known())
    }

    /// Takes the samples from index `first` on, and appends the pulses that are certain, in the
    /// order of their times. Where `first` is beyond the sample that is next there is a gap.
    ///
    /// # Errors
    ///
    /// [`DetectorError::Backwards`] if those samples were taken already.
    pub fn push(
        &mut self,
        first: u64,
        samples: &[Complex32],
        found: &mut Vec<Detection>,
    ) -> Result<(), DetectorError> {
        match self.expected {
            Some(expected) if first < expected => {
                return Err(DetectorError::Backwards { first, expected });
            }
            Some(expected) if first == expected => {}
            _ => {
                self.finish(found);
                self.segment = first;
            }
        }
        self.expected = Some(first.saturating_add(samples.len() as u64));
        let mut left = samples;
        while !left.is_empty() {
            // Blocks end at the same samples however they are divided.
            let stride = self.channeliser.decimation() << 8;
            let (part, rest) = left.split_at(left.len().min(stride - self.taken));
            left = rest;
            self.channeliser.push(part, &mut self.channels);
            self.taken += part.len();
            if self.taken == stride {
                self.taken = 0;
                if self.is_due() {
                    self.search(false, found);
                }
            }
        }
        Ok(())
    }

    /// Searches what is left, and appends the last pulses. What is pushed after it is taken for
    /// what comes after a gap.
    pub fn finish(&mut self, found: &mut Vec<Detection>) {
        self.search(true, found);
        self.channeliser.reset();
        self.channels.iter_mut().for_each(Vec::clear);
        self.windows.iter_mut().for_each(|window| window.next = 0);
        (self.origin, self.measured, self.looked, self.taken) = (0, 0, 0, 0);
        self.settled.clear();
    }

    /// The longest window.
    fn longest(&self) -> usize {
        self.windows.iter().map(|window| window.length).max().unwrap_or(1)
    }

    /// How many samples of the channels are searched at once.
    fn block(&self) -> u64 {
        samples(self.channeliser.channel_rate_hz()).max(20 * self.longest()) as u64
    }

    /// Whether enough has come for another search.
    fn is_due(&self) -> bool {
        let every = self.config.search_every_s.filter(|_| self.noise.is_known());
        let early = every.map(|every| samples(every * self.channeliser.channel_rate_hz()) as u64);
        let whole = self.end() >= self.measured + self.block();
        whole || early.is_some_and(|every| self.end() >= self.looked + every)
    }

    /// The power in dBm that a pulse of a length must have at a frequency to be found now; `None`
    /// while the noise is not known, or where the frequency is not searched.
    #[must_use]
    pub fn floor_dbm(&self, frequency_hz: f64, width_s: f64) -> Option<f64> {
        let rate = self.channeliser.channel_rate_hz();
        let about = frequency_hz - self.config.center_hz.unwrap_or(0.0);
        let place = |center: &f64| (about - center) / rate;
        let within = |(center, [low, high]): (&f64, &[f64; 2])| {
            (*low..=*high).contains(&place(center)).then(|| place(center))
        };
        let channels = self.centers_hz.iter().zip(&self.ranges).map(within).enumerate();
        let (channel, frequency) = channels.filter_map(|(i, f)| Some((i, f?))).next()?;
        let noise = f64::from(self.noise.level(channel, frequency));
        let power = self.threshold() * noise / (width_s * rate);
        self.noise.is_known().then(|| 10.0 * power.log10() + self.config.full_scale_dbm)
    }

    /// The index after the channels' last sample.
    fn end(&self) -> u64 {
        self.origin + self.channels[0].len() as u64
    }

    fn search(&mut self, last: bool, found: &mut Vec<Detection>) {
        let end = self.end();
        if last || end >= self.measured + self.block() {
            self.noise.update(&self.channels, place(self.measured, self.origin));
            self.measured = end;
        }
        self.searched += end - self.looked;
        self.looked = end;
        let threshold = self.threshold();
        #[expect(clippy::cast_possible_truncation, reason = "samples are f32")]
        let screened = (SCREENED * threshold) as f32;
        for (channel, samples) in self.channels.iter().enumerate() {
            let stretch = Stretch { channel, samples, origin: self.origin, last };
            for (width, window) in self.windows.iter_mut().enumerate() {
                window.screen(width, stretch, &self.noise, screened, &mut self.pending);
            }
        }
        self.windows.iter_mut().for_each(|window| window.advance(end, last));
        self.resolve(threshold, last, found);
        let keep = end.saturating_sub((KEPT * self.longest()) as u64).min(self.measured);
        let drop = place(keep, self.origin);
        if drop > 0 {
            self.channels.iter_mut().for_each(|channel| drop_first(channel, drop));
            self.origin += drop as u64;
        }
    }

    /// Decides on the candidates, the strongest first.
    fn resolve(&mut self, threshold: f64, last: bool, found: &mut Vec<Detection>) {
        let longest = self.longest() as u64;
        let certain = if last { u64::MAX } else { self.end().saturating_sub(OPEN * longest) };
        let mut pending = std::mem::take(&mut self.pending);
        pending.sort_by(|a, b| b.energy.total_cmp(&a.energy).then(a.start.cmp(&b.start)));
        let mut signals = self.settled.clone();
        let mut pulses = self.settled.clone();
        let given = found.len();
        for candidate in &pending {
            let extent = self.extent(candidate);
            if signals.iter().any(|signal| signal.hides(&extent, threshold)) {
                continue;
            }
            match self.judge(candidate, threshold, &pulses) {
                Verdict::Nothing => {}
                Verdict::Refused(extent) => signals.push(extent),
                Verdict::Pulse(extent, detection) => {
                    // A weaker window that reaches into a stronger signal comes out as that one.
                    if signals.iter().any(|signal| signal.hides(&extent, threshold)) {
                        continue;
                    }
                    signals.push(extent);
                    pulses.push(extent);
                    if candidate.start < certain {
                        found.push(detection);
                        self.settled.push(extent);
                    }
                }
            }
        }
        found[given..].sort_by(|a, b| a.pulse.time_s.total_cmp(&b.pulse.time_s));
        pending.retain(|candidate| candidate.start >= certain);
        self.pending = pending;
        #[expect(clippy::cast_precision_loss, reason = "below 2^52")]
        let old = self.end().saturating_sub(4 * OPEN * longest) as f64;
        self.settled.retain(|signal| signal.start + signal.length > old);
    }

    fn extent(&self, candidate: &Candidate) -> Extent {
        #[expect(clippy::cast_precision_loss, reason = "below 2^52")]
        let start = candidate.start as f64;
        Extent {
            start,
            length: float(self.windows[candidate.width].length),
            frequency: self.absolute(candidate.channel, candidate.frequency),
            energy: f64::from(candidate.energy),
        }
    }

    /// A channel's frequency about the band's centre, over the channel's rate.
    fn absolute(&self, channel: usize, frequency: f64) -> f64 {
        self.centers_hz[channel] / self.channeliser.channel_rate_hz() + frequency
    }

    /// How far a pulse may reach until another begins, in the kept samples.
    fn limits(&self, extent: &Extent, pulses: &[Extent]) -> Range<usize> {
        #[expect(clippy::cast_precision_loss, reason = "below 2^52")]
        let origin = self.origin as f64;
        let middle = extent.start + extent.length / 2.0;
        let mut limits = 0.0..float(self.channels[0].len());
        for pulse in pulses {
            let end = pulse.start + pulse.length;
            if end < middle {
                limits.start = limits.start.max(end + SMEAR - origin);
            } else if pulse.start > middle {
                limits.end = limits.end.min(pulse.start - SMEAR - origin);
            }
        }
        samples(limits.start)..samples(limits.end)
    }

    fn judge(&self, candidate: &Candidate, threshold: f64, pulses: &[Extent]) -> Verdict {
        let window = &self.windows[candidate.width];
        let Some(start) = candidate.start.checked_sub(self.origin) else { return Verdict::Nothing };
        let start = place(start, 0);
        let channel = candidate.channel;
        let view = self.view(channel, candidate.frequency);
        let peak = view.refine(start, window.length, window.hop, candidate.frequency);
        if peak.energy < threshold {
            return Verdict::Nothing;
        }
        let limits = &self.limits(&self.extent_of(channel, &peak), pulses);
        let above = view.above_carrier(&peak);
        let peak = view.with_edges(peak, self.windows[0].length / 2, limits);
        let statistic = over_burst(above, &mut self.beside(channel, &peak, pulses));
        let [low, high] = self.ranges[channel];
        let slack = 0.5 / float(peak.length);
        let extent = self.extent_of(channel, &peak);
        if statistic < threshold
            || !(low - slack..=high + slack).contains(&peak.frequency)
            || peak.length > 4 * window.length
            || view.goes_on(&peak, limits)
        {
            return Verdict::Refused(extent);
        }
        Verdict::Pulse(extent, self.detection(channel, &peak, statistic, view.noise))
    }

    fn view(&self, channel: usize, frequency: f64) -> View<'_> {
        let noise = f64::from(self.noise.level(channel, frequency));
        View { samples: &self.channels[channel], noise }
    }

    /// What is on air at a peak's time, at other frequencies of its channel and in other channels,
    /// where no pulse that was found leaks.
    fn beside(&self, channel: usize, peak: &Peak, pulses: &[Extent]) -> Vec<f64> {
        let count = self.channels.len();
        let step = count.div_ceil(OTHER_CHANNELS + 1);
        let others = (1..count).step_by(step).map(|place| (channel + place) % count);
        let cells = beside(peak).map(|cell| (channel, cell));
        let cells = cells.chain(others.map(|other| (other, Peak { frequency: 0.0, ..*peak })));
        let free = cells.filter(|(channel, cell)| {
            let extent = self.extent_of(*channel, cell);
            pulses.iter().all(|pulse| pulse.leakage(&extent) < 0.5)
        });
        free.map(|(channel, cell)| self.view(channel, cell.frequency).energy_of(&cell)).collect()
    }

    fn extent_of(&self, channel: usize, peak: &Peak) -> Extent {
        #[expect(clippy::cast_precision_loss, reason = "below 2^52")]
        let start = (self.origin + peak.start as u64) as f64;
        Extent {
            start,
            length: float(peak.length),
            frequency: self.absolute(channel, peak.frequency),
            energy: peak.energy,
        }
    }

    fn detection(&self, channel: usize, peak: &Peak, statistic: f64, noise: f64) -> Detection {
        let rate = self.channeliser.channel_rate_hz();
        let length = float(peak.length);
        let energy = peak.energy - BIAS;
        #[expect(clippy::cast_precision_loss, reason = "below 2^52")]
        let (segment, start) = (self.segment as f64, (self.origin + peak.start as u64) as f64);
        let middle = start + (length - 1.0) / 2.0;
        let decimation = float(self.channeliser.decimation());
        let input = segment + middle * decimation + self.channeliser.delay();
        let about = self.centers_hz[channel] + peak.frequency * rate;
        let pulse = Pulse::new(
            input / self.config.rate_hz,
            self.config.center_hz.unwrap_or(0.0) + about,
            length / rate,
            10.0 * (energy * noise / length).log10() + self.config.full_scale_dbm,
            10.0 * energy.log10(),
        );
        let alarms = self.alarms.rate_hz(statistic, self.noise.known()) * 3600.0;
        Detection { pulse, false_alarms_per_hour: alarms }
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked before")]
fn samples(count: f64) -> usize {
    count.round().max(0.0) as usize
}

/// Where an index is among what begins with another.
fn place(index: u64, origin: u64) -> usize {
    usize::try_from(index.saturating_sub(origin)).unwrap_or(usize::MAX)
}

fn drop_first(channel: &mut Vec<Complex32>, count: usize) {
    channel.drain(..count.min(channel.len()));
}
