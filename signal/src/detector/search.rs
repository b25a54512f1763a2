use std::ops::Range;

use rustfft::num_complex::Complex32;

use super::{
    Detection, DetectorConfig, DetectorError,
    bank::{Candidate, Stretch, Window},
    channeliser::float,
    front::{Front, index, place, samples},
    refine::{Peak, beside, over_burst},
    resolve::{Extent, SMEAR},
    threshold::FalseAlarms,
};
use crate::Pulse;

/// A grid's points are screened above this share of the threshold: between them a peak has lost at
/// most 2.1 dB.
const SCREENED: f64 = 0.55;
/// Length of a channel that is kept for reference cells, in windows of the widest.
const KEPT: usize = 15;
/// A candidate that begins nearer to the end than this, in windows of the widest, waits for more
/// samples.
const OPEN: u64 = 3;
/// The most other channels that are looked at for what is on air at a pulse's time.
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
    front: Front,
    windows: Vec<Window>,
    alarms: FalseAlarms,
    pending: Vec<Candidate>,
    /// Signals given or refused that may hide what is still open.
    settled: Vec<Extent>,
}

/// The verdict on a candidate.
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
        let front = Front::new(config)?;
        let windows =
            front.lengths.iter().map(|length| Window::new(*length, &front.ranges)).collect();
        let alarms = FalseAlarms::new(front.band_hz(), front.lengths.clone());
        Ok(Self { front, windows, alarms, pending: Vec::new(), settled: Vec::new() })
    }

    /// The time that was searched, in seconds; gaps do not count.
    #[must_use]
    pub fn searched_s(&self) -> f64 {
        self.front.searched_s()
    }

    /// The threshold of a pulse's energy over the noise's power density now, in dB.
    #[must_use]
    pub fn threshold_db(&self) -> f64 {
        10.0 * self.threshold().log10()
    }

    fn threshold(&self) -> f64 {
        let rate_hz = self.front.config.false_alarms_per_hour / 3600.0;
        self.alarms.threshold(rate_hz, self.front.noise.known())
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
        let follows = self.front.follows(first)?;
        if !follows {
            self.finish(found);
        }
        self.front.expect(first, samples.len(), follows);
        let mut left = samples;
        while !left.is_empty() {
            if self.front.take(&mut left) {
                self.search(false, found);
            }
        }
        Ok(())
    }

    /// Searches the samples not searched yet, and appends the last pulses. Samples pushed later are
    /// taken to come after a gap.
    pub fn finish(&mut self, found: &mut Vec<Detection>) {
        self.search(true, found);
        self.front.reset();
        self.windows.iter_mut().for_each(|window| window.next = 0);
        self.settled.clear();
    }

    /// The power in dBm that a pulse of a length must have at a frequency to be found now; `None`
    /// while the noise is not known, or where the frequency is not searched.
    #[must_use]
    pub fn floor_dbm(&self, frequency_hz: f64, width_s: f64) -> Option<f64> {
        let noise = self.front.noise_at(frequency_hz)?;
        Some(self.front.power_dbm(self.threshold(), noise, width_s * self.front.rate_hz()))
    }

    fn search(&mut self, last: bool, found: &mut Vec<Detection>) {
        self.front.measure(last);
        let end = self.front.end();
        let threshold = self.threshold();
        #[expect(clippy::cast_possible_truncation, reason = "samples are f32")]
        let screened = (SCREENED * threshold) as f32;
        for (channel, samples) in self.front.channels.iter().enumerate() {
            let stretch = Stretch { channel, samples, origin: self.front.origin, last };
            for (width, window) in self.windows.iter_mut().enumerate() {
                window.screen(width, stretch, &self.front.noise, screened, &mut self.pending);
            }
        }
        self.windows.iter_mut().for_each(|window| window.advance(end, last));
        self.resolve(threshold, last, found);
        self.front.forget(end.saturating_sub((KEPT * self.front.longest()) as u64));
    }

    /// Decides on the candidates, the strongest first.
    fn resolve(&mut self, threshold: f64, last: bool, found: &mut Vec<Detection>) {
        let longest = self.front.longest() as u64;
        let certain = if last { u64::MAX } else { self.front.end().saturating_sub(OPEN * longest) };
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
        let old = index(self.front.end().saturating_sub(4 * OPEN * longest));
        self.settled.retain(|signal| signal.start + signal.length > old);
    }

    fn extent(&self, candidate: &Candidate) -> Extent {
        Extent {
            start: index(candidate.start),
            length: float(self.windows[candidate.width].length),
            frequency: self.front.absolute(candidate.channel, candidate.frequency),
            energy: f64::from(candidate.energy),
        }
    }

    /// The range of the kept samples that a pulse may reach over until another begins.
    fn limits(&self, extent: &Extent, pulses: &[Extent]) -> Range<usize> {
        let origin = index(self.front.origin);
        let middle = extent.start + extent.length / 2.0;
        let mut limits = 0.0..float(self.front.channels[0].len());
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
        let Some(start) = candidate.start.checked_sub(self.front.origin) else {
            return Verdict::Nothing;
        };
        let start = place(start, 0);
        let channel = candidate.channel;
        let view = self.front.view(channel, candidate.frequency);
        let peak = view.refine(start, window.length, window.hop, candidate.frequency);
        if peak.energy < threshold {
            return Verdict::Nothing;
        }
        let limits = &self.limits(&self.extent_of(channel, &peak), pulses);
        let above = view.above_carrier(&peak);
        let peak = view.with_edges(peak, self.windows[0].length / 2, limits);
        let statistic = over_burst(above, &mut self.beside(channel, &peak, pulses));
        let [low, high] = self.front.ranges[channel];
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

    /// The energies at a peak's time, at other frequencies of its channel and in other channels,
    /// where no pulse that was found leaks.
    fn beside(&self, channel: usize, peak: &Peak, pulses: &[Extent]) -> Vec<f64> {
        let count = self.front.channels.len();
        let step = count.div_ceil(OTHER_CHANNELS + 1);
        let others = (1..count).step_by(step).map(|place| (channel + place) % count);
        let cells = beside(peak).map(|cell| (channel, cell));
        let cells = cells.chain(others.map(|other| (other, Peak { frequency: 0.0, ..*peak })));
        let free = cells.filter(|(channel, cell)| {
            let extent = self.extent_of(*channel, cell);
            pulses.iter().all(|pulse| pulse.leakage(&extent) < 0.5)
        });
        free.map(|(channel, cell)| self.front.view(channel, cell.frequency).energy_of(&cell))
            .collect()
    }

    fn extent_of(&self, channel: usize, peak: &Peak) -> Extent {
        Extent {
            start: index(self.front.origin + peak.start as u64),
            length: float(peak.length),
            frequency: self.front.absolute(channel, peak.frequency),
            energy: peak.energy,
        }
    }

    fn detection(&self, channel: usize, peak: &Peak, statistic: f64, noise: f64) -> Detection {
        let length = float(peak.length);
        let energy = peak.energy - BIAS;
        let start = index(self.front.origin + peak.start as u64);
        let pulse = Pulse::new(
            self.front.time_s(start + (length - 1.0) / 2.0),
            self.front.frequency_hz(self.front.absolute(channel, peak.frequency)),
            length / self.front.rate_hz(),
            self.front.power_dbm(energy, noise, length),
            10.0 * energy.log10(),
        );
        let alarms = self.alarms.rate_hz(statistic, self.front.noise.known()) * 3600.0;
        Detection { pulse, false_alarms_per_hour: alarms }
    }
}
