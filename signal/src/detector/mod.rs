//! Pulses found in complex samples, at a rate of false alarms that the user sets.
//!
//! Samples are divided into channels, and each channel is searched by a bank of windows as long as
//! the pulses may be. What stands out is refined, strongest first, and passes if it is above the
//! threshold that the rate of false alarms gives, ends on both sides, and is neither part of a
//! stronger pulse nor of a burst over all frequencies.

mod channeliser;
mod config;
mod fold;
mod search;

pub use config::{Detection, DetectorConfig, DetectorError, FoldConfig};
pub use fold::{Train, TrainDetector};
pub use search::Detector;

use std::{
    f64::consts::{LN_2, TAU},
    ops::Range,
};

use rustfft::num_complex::{Complex32, Complex64};

use channeliser::{Channeliser, Noise, float};

/// The least energy that a change of both ends must win, in units of the noise, as two numbers are
/// fitted.
const EDGES_WORTH: f64 = 2.5;

/// Reference cells on each side.
const REFERENCES: usize = 8;

/// Above this, a median of reference cells is not noise: one of seven is with probability 0.002.
const LIT: f64 = 2.5;

/// Limit of the median of fewer than twelve cells beside a peak: noise exceeds it with probability
/// 6e-5 for five cells.
const LIT_FEW: f64 = 4.0;

/// Limit of the median of twelve cells or more, above the median of noise, times the root of their
/// number: noise exceeds it with probability 0.002, by the binomial distribution of the cells
/// above, for 12 cells as for 32.
const LIT_MANY: f64 = 4.6;

/// The front end of all detectors: a stream of samples divided into channels, in blocks of about a
/// second, and the level of the noise in each.
#[derive(Debug)]
struct Front {
    config: DetectorConfig,
    channeliser: Channeliser,
    centers_hz: Vec<f64>,
    /// The range of frequencies that each channel has of its own, over its rate.
    ranges: Vec<[f64; 2]>,
    /// Samples of a channel in a pulse of each width, ascending.
    lengths: Vec<usize>,
    noise: Noise,
    channels: Vec<Vec<Complex32>>,
    /// The index of the channels' first kept sample, from the last gap.
    origin: u64,
    /// Index from which on the noise is not measured yet, from the last gap.
    measured: u64,
    /// Index from which on nothing was searched yet, from the last gap.
    looked: u64,
    /// The input's index of the first sample after the last gap, and of the next one.
    segment: u64,
    expected: Option<u64>,
    /// Samples since a block could last end.
    taken: usize,
    /// Samples of a channel that were searched.
    searched: u64,
}

impl Front {
    fn new(config: DetectorConfig) -> Result<Self, DetectorError> {
        config.check()?;
        let band = config.band_about_center();
        let (narrow, _) = config.narrow_and_wide();
        // Fifteen samples in the narrowest window, and not less than fine steps in time need.
        let spacing_hz = (10.0 / narrow).max(4e3);
        let channeliser = Channeliser::new(config.rate_hz, spacing_hz, band);
        let centers_hz = channeliser.centers_hz();
        let rate = channeliser.channel_rate_hz();
        let half = channeliser.spacing_hz() / 2.0;
        let range = |center: &f64| {
            [band[0].max(center - half), band[1].min(center + half)].map(|f| (f - center) / rate)
        };
        let ranges: Vec<_> = centers_hz.iter().map(range).collect();
        let mut lengths: Vec<usize> =
            config.widths_s.iter().map(|width| samples(width * rate).max(1)).collect();
        lengths.sort_unstable();
        lengths.dedup();
        // White noise falls on all channels' rates alike.
        let least = config.least_noise / float(channeliser.decimation());
        let noise = Noise::new(lengths[lengths.len() / 2].max(8), &ranges, least);
        let channels = vec![Vec::new(); centers_hz.len()];
        Ok(Self {
            config,
            channeliser,
            centers_hz,
            ranges,
            lengths,
            noise,
            channels,
            origin: 0,
            measured: 0,
            looked: 0,
            segment: 0,
            expected: None,
            taken: 0,
            searched: 0,
        })
    }

    /// The time that was searched, in seconds; gaps do not count.
    fn searched_s(&self) -> f64 {
        let searched = index(self.searched);
        searched / self.rate_hz()
    }

    /// Samples of a channel per second.
    fn rate_hz(&self) -> f64 {
        self.channeliser.channel_rate_hz()
    }

    /// Width of the band that is searched, in hertz.
    fn band_hz(&self) -> f64 {
        let [low, high] = self.config.band_about_center();
        high - low
    }

    /// The longest pulse, in samples of a channel.
    fn longest(&self) -> usize {
        self.lengths.last().copied().unwrap_or(1)
    }

    /// The number of samples of the channels that are searched at once.
    fn block(&self) -> u64 {
        samples(self.rate_hz()).max(20 * self.longest()) as u64
    }

    /// The index after the channels' last sample.
    fn end(&self) -> u64 {
        self.origin + self.channels[0].len() as u64
    }

    /// Returns true if samples from index `first` on follow those before, and false after a gap.
    fn follows(&self, first: u64) -> Result<bool, DetectorError> {
        match self.expected {
            Some(expected) if first < expected => Err(DetectorError::Backwards { first, expected }),
            expected => Ok(expected == Some(first)),
        }
    }

    /// Announces `count` samples from index `first` on.
    fn expect(&mut self, first: u64, count: usize, follows: bool) {
        if !follows {
            self.segment = first;
        }
        self.expected = Some(first.saturating_add(count as u64));
    }

    /// Takes as many of the samples as a block may hold, and returns whether a search is due.
    /// Blocks end at the same samples however these are divided.
    fn take(&mut self, left: &mut &[Complex32]) -> bool {
        let stride = self.channeliser.decimation() << 8;
        let (part, rest) = left.split_at(left.len().min(stride - self.taken));
        *left = rest;
        self.channeliser.push(part, &mut self.channels);
        self.taken += part.len();
        if self.taken < stride {
            return false;
        }
        self.taken = 0;
        let every = self.config.search_every_s.filter(|_| self.noise.is_known());
        let early = every.map(|every| samples(every * self.rate_hz()) as u64);
        self.is_whole() || early.is_some_and(|every| self.end() >= self.looked + every)
    }

    /// Returns true if a block is complete.
    fn is_whole(&self) -> bool {
        self.end() >= self.measured + self.block()
    }

    /// Measures the noise of a block that is complete, or is the last one.
    fn measure(&mut self, last: bool) {
        let end = self.end();
        if last || self.is_whole() {
            self.noise.update(&self.channels, place(self.measured, self.origin));
            self.measured = end;
        }
        self.searched += end - self.looked;
        self.looked = end;
    }

    /// The noise at a frequency in hertz: power over the channels' rate. `None` while it is not
    /// known, or where the frequency is not searched.
    fn noise_at(&self, frequency_hz: f64) -> Option<f64> {
        let about = frequency_hz - self.config.center_hz.unwrap_or(0.0);
        let place = |center: &f64| (about - center) / self.rate_hz();
        let within = |(center, [low, high]): (&f64, &[f64; 2])| {
            (*low..=*high).contains(&place(center)).then(|| place(center))
        };
        let channels = self.centers_hz.iter().zip(&self.ranges).map(within).enumerate();
        let (channel, frequency) = channels.filter_map(|(i, f)| Some((i, f?))).next()?;
        self.noise.is_known().then(|| f64::from(self.noise.level(channel, frequency)))
    }

    /// Forgets all samples before this index, but for those whose noise is not measured yet.
    fn forget(&mut self, before: u64) {
        let drop = place(before.min(self.measured), self.origin);
        if drop > 0 {
            self.channels.iter_mut().for_each(|channel| drop_first(channel, drop));
            self.origin += drop as u64;
        }
    }

    /// Forgets all samples; what comes next comes after a gap.
    fn reset(&mut self) {
        self.channeliser.reset();
        self.channels.iter_mut().for_each(Vec::clear);
        (self.origin, self.measured, self.looked, self.taken) = (0, 0, 0, 0);
    }

    /// The kept samples of a channel, and the noise's level at a frequency.
    fn view(&self, channel: usize, frequency: f64) -> View<'_> {
        let noise = f64::from(self.noise.level(channel, frequency));
        View { samples: &self.channels[channel], noise }
    }

    /// A channel's frequency about the band's centre, over the channel's rate.
    fn absolute(&self, channel: usize, frequency: f64) -> f64 {
        self.centers_hz[channel] / self.rate_hz() + frequency
    }

    /// A frequency about the band's centre, over the channels' rate, in hertz.
    fn frequency_hz(&self, absolute: f64) -> f64 {
        self.config.center_hz.unwrap_or(0.0) + absolute * self.rate_hz()
    }

    /// The time of a place among a channel's samples, counted from the last gap.
    fn time_s(&self, place: f64) -> f64 {
        let decimation = float(self.channeliser.decimation());
        let input = index(self.segment) + place * decimation + self.channeliser.delay();
        input / self.config.rate_hz
    }

    /// The power of a pulse of this energy over the noise's power density, in the settings' terms.
    fn power_dbm(&self, energy: f64, noise: f64, length: f64) -> f64 {
        10.0 * (energy * noise / length).log10() + self.config.full_scale_dbm
    }
}

/// Samples of a channel, and the noise's power in each.
#[derive(Debug, Clone, Copy)]
struct View<'a> {
    samples: &'a [Complex32],
    noise: f64,
}

/// A stretch of a channel at one frequency.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Peak {
    start: usize,
    length: usize,
    /// Frequency over the channel's rate.
    frequency: f64,
    /// Energy over the noise's power density: exponential with mean 1 where there is noise alone.
    energy: f64,
}

impl View<'_> {
    fn energy(&self, start: usize, length: usize, frequency: f64) -> f64 {
        let Some(samples) = self.samples.get(start..start.saturating_add(length)) else {
            return 0.0;
        };
        let step = Complex64::from_polar(1.0, -TAU * frequency);
        let mut turn = Complex64::new(1.0, 0.0);
        let mut sum = Complex64::default();
        for sample in samples {
            sum += turn * Complex64::new(sample.re.into(), sample.im.into());
            turn *= step;
        }
        sum.norm_sqr() / (float(length) * self.noise)
    }

    /// Sums of the samples from `from`, turned back by a frequency; as many as there are and one.
    fn sums(&self, from: usize, to: usize, frequency: f64) -> Vec<Complex64> {
        let step = Complex64::from_polar(1.0, -TAU * frequency);
        let mut turn = Complex64::new(1.0, 0.0);
        let mut sum = Complex64::default();
        let mut sums = Vec::with_capacity(to - from + 1);
        sums.push(sum);
        for sample in &self.samples[from..to] {
            sum += turn * Complex64::new(sample.re.into(), sample.im.into());
            turn *= step;
            sums.push(sum);
        }
        sums
    }

    /// The highest energy near a place: over all starts within a hop and all frequencies within a
    /// bin.
    fn refine(&self, start: usize, length: usize, hop: usize, frequency: f64) -> Peak {
        let bin = 0.5 / float(length);
        let frequency = self.best_frequency(start, length, frequency, bin / 2.0);
        let from = start.saturating_sub(hop);
        let to = (start + hop + length).min(self.samples.len());
        let sums = self.sums(from, to, frequency);
        let energy = |(n, (a, b)): (usize, (&Complex64, &Complex64))| (n, (b - a).norm_sqr());
        let ends = sums.iter().zip(sums.iter().skip(length)).enumerate().map(energy);
        let best = ends.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(n, _)| n);
        self.settle(from + best, length, frequency)
    }

    /// The best frequency for a start and length.
    fn settle(&self, start: usize, length: usize, frequency: f64) -> Peak {
        let bin = 0.5 / float(length);
        let frequency = self.best_frequency(start, length, frequency, bin / 4.0);
        Peak { start, length, frequency, energy: self.energy(start, length, frequency) }
    }

    /// Steps uphill, then the vertex of the parabola through three points.
    fn best_frequency(&self, start: usize, length: usize, frequency: f64, step: f64) -> f64 {
        let at = |frequency| self.energy(start, length, frequency);
        let mut frequency = frequency;
        let [mut low, mut middle, mut high] =
            [at(frequency - step), at(frequency), at(frequency + step)];
        for _ in 0..6 {
            if high > middle && high >= low {
                (low, middle, frequency) = (middle, high, frequency + step);
                high = at(frequency + step);
            } else if low > middle {
                (high, middle, frequency) = (middle, low, frequency - step);
                low = at(frequency - step);
            } else {
                break;
            }
        }
        let curvature = 2.0 * middle - low - high;
        if curvature <= 0.0 {
            return frequency;
        }
        frequency + step * ((high - low) / (2.0 * curvature)).clamp(-0.5, 0.5)
    }

    /// The peak with its ends where its energy is highest, if they win more than noise does; never
    /// beyond the limits.
    fn with_edges(&self, peak: Peak, shortest: usize, limits: &Range<usize>) -> Peak {
        let mut best = peak;
        for _ in 0..3 {
            let from = best.start.saturating_sub(3 * best.length / 2).max(limits.start);
            let to = (best.start + 5 * best.length / 2).min(limits.end).min(self.samples.len());
            if from > best.start || to < best.start + best.length {
                break;
            }
            let sums = self.sums(from, to, best.frequency);
            let energy =
                |a: usize, b: usize| (sums[b] - sums[a]).norm_sqr() / (float(b - a) * self.noise);
            let highest = |range: &mut dyn Iterator<Item = (usize, usize)>| {
                range.max_by(|x, y| energy(x.0, x.1).total_cmp(&energy(y.0, y.1)))
            };
            let mut a = best.start - from;
            let mut b = best.start + best.length - from;
            for _ in 0..2 {
                let ends = a + shortest.max(1)..sums.len();
                (a, b) = highest(&mut ends.map(|end| (a, end))).unwrap_or((a, b));
                let starts = 0..(b + 1).saturating_sub(shortest.max(1));
                (a, b) = highest(&mut starts.map(|start| (start, b))).unwrap_or((a, b));
            }
            let next = self.settle(from + a, b - a, best.frequency);
            let moved = (next.start, next.length) != (best.start, best.length);
            if next.energy <= best.energy || !moved {
                break;
            }
            best = next;
        }
        if best.energy > peak.energy + EDGES_WORTH { best } else { peak }
    }

    /// Returns true if it goes on beyond both ends, or, if it is strong, beyond one: then it is
    /// part of something longer than the bank's windows. What is beyond the limits is another
    /// pulse.
    fn goes_on(&self, peak: &Peak, limits: &Range<usize>) -> bool {
        let flank = (peak.length / 4).max(1);
        let guard = (peak.length / 16).max(2);
        let share = float(flank) / float(peak.length) * peak.energy;
        let inside = |start: &usize| *start >= limits.start && start + flank <= limits.end;
        let on = |start: Option<usize>| {
            start
                .filter(inside)
                .is_some_and(|start| self.energy(start, flank, peak.frequency) > 0.5 * share + LIT)
        };
        let before = on(peak.start.checked_sub(guard + flank));
        let after = on(Some(peak.start + peak.length + guard));
        (before && after) || (peak.energy > 60.0 && (before || after))
    }

    /// The part of a peak's energy that is above what its bin holds at other times (OS-CFAR:
    /// Rohling 1983): where the median there is above that of noise there is a carrier, and only
    /// the amplitude above the carrier's counts.
    fn above_carrier(&self, peak: &Peak) -> f64 {
        let Peak { start, length, frequency, energy } = *peak;
        let mut times = Vec::with_capacity(2 * REFERENCES);
        for m in 1..=REFERENCES {
            let away = m * 3 * length / 2;
            if let Some(before) = start.checked_sub(away) {
                times.push(self.energy(before, length, frequency));
            }
            if start + away + length <= self.samples.len() {
                times.push(self.energy(start + away, length, frequency));
            }
        }
        let carrier = median(&mut times).filter(|level| *level > LIT).unwrap_or(0.0);
        (energy.sqrt() - carrier.sqrt()).max(0.0).powi(2)
    }

    /// The energy of a stretch.
    fn energy_of(&self, peak: &Peak) -> f64 {
        self.energy(peak.start, peak.length, peak.frequency)
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked before")]
fn samples(count: f64) -> usize {
    count.round().max(0.0) as usize
}

#[expect(clippy::cast_precision_loss, reason = "below 2^52")]
fn index(index: u64) -> f64 {
    index as f64
}

/// The offset of an index from `origin`; 0 if it is before.
fn place(index: u64, origin: u64) -> usize {
    usize::try_from(index.saturating_sub(origin)).unwrap_or(usize::MAX)
}

fn drop_first(channel: &mut Vec<Complex32>, count: usize) {
    channel.drain(..count.min(channel.len()));
}

/// The cells to look at for what is on air beside a peak, at its time and at other frequencies of
/// its channel.
///
/// A rectangular pulse has zeros at multiples of its inverse length. A channel is flat over two
/// thirds of its rate.
fn beside(peak: &Peak) -> impl Iterator<Item = Peak> {
    let length = float(peak.length);
    let step = (length / (3.0 * float(REFERENCES))).floor().max(1.0) / length;
    let steps = (1..=REFERENCES).flat_map(|m| [-1.0, 1.0].map(|sign| sign * (float(m) + 1.0)));
    let peak = *peak;
    steps
        .map(move |steps| Peak { frequency: peak.frequency + steps * step, ..peak })
        .filter(|cell| cell.frequency.abs() < 0.34)
}

/// The worth of a statistic over cells beside it. If their median is that of noise, the statistic
/// itself; otherwise there is a burst over all frequencies, which is its noise. Few cells give its
/// level: an exponential over the mean of k has (1 + x/k)^−k where one over its own level has
/// e^−x. A median of 2k is worth about k.
fn over_burst(statistic: f64, cells: &mut [f64]) -> f64 {
    let count = float(cells.len());
    let known = 0.5 * count;
    let lit = if cells.len() < 12 { LIT_FEW } else { LN_2 + LIT_MANY / count.sqrt() };
    match median(cells).filter(|level| *level > lit) {
        None => statistic,
        Some(level) => known * (statistic * LN_2 / level / known).ln_1p(),
    }
}

/// The median of at least five.
fn median(values: &mut [f64]) -> Option<f64> {
    if values.len() < 5 {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    /// A tone of this amplitude in a stretch of 1,000 samples that are 0 otherwise.
    fn tone(range: Range<usize>, amplitude: f32) -> Vec<Complex32> {
        let mut samples = vec![Complex32::default(); 1000];
        for (n, sample) in samples.iter_mut().enumerate() {
            if range.contains(&n) {
                let angle = TAU * 0.1 * float(n);
                #[expect(clippy::cast_possible_truncation, reason = "samples are f32")]
                let turned = Complex32::new(angle.cos() as f32, angle.sin() as f32);
                *sample = turned * amplitude;
            }
        }
        samples
    }

    #[test]
    fn what_goes_on_beyond_its_ends_is_no_pulse() {
        let goes_on = |range: Range<usize>, amplitude: f32, limits: &Range<usize>| {
            let samples = tone(range, amplitude);
            let view = View { samples: &samples, noise: 1.0 };
            let energy = view.energy(400, 100, 0.1);
            view.goes_on(&Peak { start: 400, length: 100, frequency: 0.1, energy }, limits)
        };
        let all = 0..1000;
        assert!(!goes_on(400..500, 1.0, &all), "a pulse");
        // A strong one that is up to a guard longer on either side is still that pulse.
        assert!(!goes_on(396..505, 3.0, &all), "soft ends");
        assert!(goes_on(300..600, 0.6, &all), "beyond both ends");
        // Energies of 36, where noise may look so, and of 100.
        assert!(!goes_on(400..600, 0.6, &all), "weak, beyond one end");
        assert!(goes_on(400..600, 1.0, &all), "clear, beyond one end");
        assert!(goes_on(300..500, 1.0, &all), "clear, beyond the other");
        // What is beyond the limits is another pulse.
        assert!(!goes_on(300..600, 1.0, &(400..500)), "between others");
        assert!(!goes_on(400..600, 1.0, &(0..500)), "before another");
    }

    #[test]
    fn a_burst_over_all_frequencies_is_the_noise_of_what_is_in_it() {
        // The median of an exponential's sixteen cells is ln 2 of its level.
        let cells = |level: f64, count: usize| vec![level * LN_2; count];
        for (level, count) in [(1.0, 16), (2.6, 16), (2.1, 32), (5.0, 8)] {
            assert!((over_burst(40.0, &mut cells(level, count)) - 40.0).abs() < 1e-12, "noise");
        }
        // Level 10 by sixteen cells: (1 + 4/8)^-8.
        let left = over_burst(40.0, &mut cells(10.0, 16));
        assert_abs_diff_eq!(left, 8.0 * 1.5_f64.ln(), epsilon = 1e-9);
        // Level 2.4 by 32 cells.
        let weak = over_burst(40.0, &mut cells(2.4, 32));
        assert_abs_diff_eq!(weak, 16.0 * (40.0_f64 / 2.4 / 16.0).ln_1p(), epsilon = 1e-9);
        // The fewer cells the less is known of the level, and the less is left.
        let few = over_burst(40.0, &mut cells(10.0, 8));
        assert!(few < left && few > 2.0, "{few}");
        assert!((over_burst(40.0, &mut cells(100.0, 4)) - 40.0).abs() < 1e-12, "too few cells");
    }
}
