//! Single pulses: screened by a bank of windows, refined, and told from the leakage of stronger
//! ones.

use std::{f64::consts::PI, fmt, mem, ops::Range, sync::Arc};

use rustfft::{Fft, FftPlanner, num_complex::Complex32};

use super::{
    Detection, DetectorConfig, DetectorError, Front, Peak, beside,
    channeliser::{Noise, float, places, signed, transform_size},
    config::FalseAlarms,
    index, over_burst, place, samples,
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

/// Length by which the filter of a channel smears a pulse's ends, in samples.
const SMEAR: f64 = 3.0;

/// Near a pulse's frequency, up to `NEAR` of its inverse length, up to this factor above the bound
/// is taken for leakage: 6 dB, as pulses have no exact shape. Farther off their ends are softer.
const MARGIN: f64 = 4.0;
const NEAR: f64 = 10.0;

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

/// A place in time, frequency and width that may be a pulse.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    channel: usize,
    /// Index of the window in the bank.
    width: usize,
    /// The window's first sample, as the channel counts.
    start: u64,
    /// Frequency about the channel's middle, over its rate.
    frequency: f64,
    /// Energy over the noise's power density.
    energy: f32,
}

/// One window of the bank: rectangular, as long as a pulse, begun every quarter of its length,
/// in bins of half its inverse length.
struct Window {
    length: usize,
    hop: usize,
    fft: Arc<dyn Fft<f32>>,
    scratch: Vec<Complex32>,
    buffer: Vec<Complex32>,
    /// The bins of each channel that are its own and one more on each side, ascending.
    bins: Vec<Vec<usize>>,
    /// The bins of each channel as contiguous ranges of the transform.
    runs: Vec<Vec<Range<usize>>>,
    /// The first frame not yet looked at, as the channels count.
    next: u64,
    /// The powers of three frames that follow each other.
    rows: [Vec<f32>; 3],
    weights: Vec<f32>,
}

impl fmt::Debug for Window {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("Window")
            .field("length", &self.length)
            .field("next", &self.next)
            .finish_non_exhaustive()
    }
}

/// Samples of one channel that are to be searched.
#[derive(Debug, Clone, Copy)]
struct Stretch<'a> {
    channel: usize,
    samples: &'a [Complex32],
    /// The first sample's index, as the channel counts.
    origin: u64,
    /// True if nothing follows.
    last: bool,
}

impl Window {
    /// A window of this many samples; of each channel the range of frequencies over its rate.
    fn new(length: usize, ranges: &[[f64; 2]]) -> Self {
        let size = transform_size(length);
        let fft = FftPlanner::new().plan_fft_forward(size);
        let scratch = vec![Complex32::default(); fft.get_inplace_scratch_len()];
        let more = 1.0 / float(size);
        let bins = ranges.iter().map(|[low, high]| places(size, [low - more, high + more]));
        let bins: Vec<_> = bins.collect();
        let runs = bins.iter().map(|bins| {
            bins.chunk_by(|a, b| a + 1 == *b).map(|run| run[0]..run[0] + run.len()).collect()
        });
        Self {
            length,
            hop: (length / 4).max(1),
            fft,
            scratch,
            buffer: vec![Complex32::default(); size],
            runs: runs.collect(),
            bins,
            next: 0,
            rows: Default::default(),
            weights: Vec::new(),
        }
    }

    /// Moves to the first frame after the frames of a stretch that ends at `end`.
    fn advance(&mut self, end: u64, last: bool) {
        // A frame is looked at when the one after it is there.
        let needed = (self.length + if last { 0 } else { self.hop }) as u64;
        while self.next + needed <= end {
            self.next += self.hop as u64;
        }
    }

    /// Looks at the frames of a stretch; what is above the threshold and its neighbours in time and
    /// frequency is a candidate.
    ///
    /// A frame in which nearly all bins are above the threshold and about the same is a burst over
    /// all frequencies, and gives none.
    fn screen(
        &mut self,
        width: usize,
        stretch: Stretch<'_>,
        noise: &Noise,
        threshold: f32,
        candidates: &mut Vec<Candidate>,
    ) {
        let Stretch { channel, samples, origin, last } = stretch;
        let size = self.buffer.len();
        self.weights.clear();
        for bin in &self.bins[channel] {
            let level = noise.level(channel, signed(*bin, size));
            #[expect(clippy::cast_precision_loss, reason = "a window's length")]
            self.weights.push(1.0 / (level * self.length as f32));
        }
        self.rows.iter_mut().for_each(Vec::clear);
        let hop = self.hop as u64;
        let mut start = self.next.saturating_sub(hop);
        if start < origin || self.next < hop {
            start = self.next;
        }
        loop {
            let at = usize::try_from(start - origin).unwrap_or(usize::MAX);
            let frame = at.checked_add(self.length).and_then(|end| samples.get(at..end));
            self.rows.rotate_left(1);
            let mut row = mem::take(&mut self.rows[2]);
            row.clear();
            if let Some(frame) = frame {
                self.transform(frame);
                let mut weights = self.weights.as_slice();
                for run in &self.runs[channel] {
                    let (own, rest) = weights.split_at(run.len());
                    let bins = self.buffer[run.clone()].iter().zip(own);
                    row.extend(bins.map(|(bin, weight)| bin.norm_sqr() * weight));
                    weights = rest;
                }
            }
            self.rows[2] = row;
            // Now the row in the middle has its neighbours.
            if !self.rows[1].is_empty() && start >= self.next + hop && (frame.is_some() || last) {
                self.peaks(width, channel, start - hop, threshold, candidates);
            }
            if frame.is_none() {
                break;
            }
            start += hop;
        }
    }

    fn transform(&mut self, frame: &[Complex32]) {
        self.buffer[..frame.len()].copy_from_slice(frame);
        self.buffer[frame.len()..].fill(Complex32::default());
        self.fft.process_with_scratch(&mut self.buffer, &mut self.scratch);
    }

    fn peaks(
        &self,
        width: usize,
        channel: usize,
        start: u64,
        threshold: f32,
        candidates: &mut Vec<Candidate>,
    ) {
        let [before, row, after] = &self.rows;
        // Nearly all frames end here; a count is quicker than a maximum.
        let above: u32 = row.iter().map(|power| u32::from(*power > threshold)).sum();
        if above == 0 || is_burst(row, threshold) {
            return;
        }
        let size = self.buffer.len();
        for (place, power) in row.iter().enumerate().filter(|(_, power)| **power > threshold) {
            let near = place.saturating_sub(1)..=place + 1;
            let highest = |row: &[f32]| {
                let most = row.len().saturating_sub(1);
                let near = row.get(*near.start().min(&most)..=(*near.end()).min(most));
                near.unwrap_or(&[]).iter().fold(0.0_f32, |top, power| top.max(*power))
            };
            if *power >= highest(row) && *power >= highest(before) && *power >= highest(after) {
                let frequency = signed(self.bins[channel][place], size);
                candidates.push(Candidate { channel, width, start, frequency, energy: *power });
            }
        }
    }
}

/// A part of time and frequency that a signal takes, in a channel's samples and cycles per sample
/// about the band's centre.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Extent {
    start: f64,
    length: f64,
    frequency: f64,
    /// Energy over the noise's power density.
    energy: f64,
}

impl Extent {
    fn end(&self) -> f64 {
        self.start + self.length
    }

    /// The most energy that a rectangular pulse like this has in a window of another one's place,
    /// length and frequency.
    ///
    /// Over an overlap o of both, at a distance Δ in frequency, a tone's sum is at most
    /// min(o, 1/(πΔ)) amplitudes.
    fn leakage(&self, other: &Self) -> f64 {
        let overlap = self.overlap(other);
        let away = (other.frequency - self.frequency).abs();
        let sum = if away > 0.0 { overlap.min(1.0 / (PI * away)) } else { overlap };
        self.energy / self.length * sum * sum / other.length
    }

    fn overlap(&self, other: &Self) -> f64 {
        let first = other.start.max(self.start - SMEAR);
        (other.end().min(self.end() + SMEAR) - first).max(0.0)
    }

    /// Returns true if another, weaker one is part of this one: it is not above what leaks, or what
    /// is above that is below the threshold.
    fn hides(&self, other: &Self, threshold: f64) -> bool {
        let overlap = self.overlap(other);
        if overlap <= 0.0 {
            return false;
        }
        let away = (other.frequency - self.frequency).abs();
        let near = away < 1.0 / other.length + 0.5 / self.length;
        if near && overlap >= 0.5 * self.length.min(other.length) {
            return true;
        }
        let leakage = self.leakage(other);
        let margin = if away * self.length < NEAR { MARGIN } else { 1.0 };
        // Screened on a grid, the other has lost up to 2.1 dB.
        let above = other.energy.sqrt() - leakage.sqrt();
        other.energy < margin * leakage || above < 0.78 * threshold.sqrt()
    }
}

/// Returns true if a frame is above the threshold nearly everywhere and has no line that stands
/// out, as clicks have: the lines of a pulse stand far above its own side lobes.
fn is_burst(row: &[f32], threshold: f32) -> bool {
    let top = row.iter().fold(0.0_f32, |top, power| top.max(*power));
    let above = row.iter().filter(|power| **power > threshold).count();
    if row.len() < 8 || 2 * above < row.len() {
        return false;
    }
    let mut sorted = row.to_vec();
    let (_, median, _) = sorted.select_nth_unstable_by(row.len() / 2, f32::total_cmp);
    top < 20.0 * *median
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_that_is_lit_everywhere_is_a_burst() {
        let noise: [f32; 16] =
            [0.2, 1.4, 0.7, 2.1, 0.1, 0.9, 3.0, 0.5, 1.1, 0.3, 1.9, 0.6, 0.8, 1.2, 2.6, 0.4];
        let times = |level: f32| noise.map(|power| level * power);
        assert!(!is_burst(&noise, 11.0), "noise");
        assert!(is_burst(&times(100.0), 11.0), "a click");
        assert!(is_burst(&times(15.0), 11.0), "half of it above the threshold");
        assert!(!is_burst(&times(10.0), 11.0), "less than half");
        // A pulse in a click stands out, and a strong one's side lobes are far below its line.
        let mut pulse = times(100.0);
        pulse[6] = 20.0 * 100.0;
        assert!(!is_burst(&pulse, 11.0), "a pulse in a click");
        pulse[6] = 19.0 * 90.0;
        assert!(is_burst(&pulse, 11.0), "a line like those of the click");
        assert!(!is_burst(&times(100.0)[..7], 11.0), "too few bins");
    }

    #[test]
    fn side_lobes_are_hidden_and_others_are_not() {
        let strong = Extent { start: 1000.0, length: 100.0, frequency: 0.1, energy: 1e5 };
        let hides = |other: &Extent| strong.hides(other, 20.0);
        let weak = |start, length, frequency, energy| Extent { start, length, frequency, energy };
        // The first side lobe, −13 dB, and one far off, −40 dB.
        assert!(hides(&weak(1000.0, 100.0, 0.115, 5e3)));
        assert!(hides(&weak(1000.0, 100.0, 0.1 + 0.325, 10.0)));
        // 10 dB above the leakage there.
        assert!(!hides(&weak(1000.0, 100.0, 0.1 + 0.325, 100.0)));
        // Right after it, at the same frequency; and half in it.
        assert!(!hides(&weak(1104.0, 100.0, 0.1, 30.0)));
        assert!(hides(&weak(1050.0, 100.0, 0.1, 2e4)));
        // A narrow window inside it.
        assert!(hides(&weak(1040.0, 12.0, 0.1, 1.2e4)));
    }
}
