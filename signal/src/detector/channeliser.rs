//! Samples divided into channels, and the noise in these over frequency.

use std::{
    collections::VecDeque,
    f64::consts::{PI, TAU},
    fmt,
    sync::Arc,
};

use rustfft::{Fft, FftPlanner, num_complex::Complex32};

/// Length of the prototype filter in channels' spacings; with the transition below that is 65 dB
/// of attenuation where channels fold.
const LENGTH: usize = 10;
const KAISER_BETA: f64 = 6.2;

/// The quantile of a bin's powers that is taken for its level: pulses may last three quarters of
/// the time.
const QUANTILE: f64 = 0.25;

/// The number of blocks that are remembered.
const BLOCKS: usize = 4;

/// The number of bins on each side that are looked at.
const NEIGHBOURS: usize = 10;

/// Divides a band into channels of a lower rate, with a polyphase filter (Crochiere & Rabiner 1983,
/// chapter 7: weighted overlap and add).
///
/// Channels are `spacing_hz` apart and have 1.5 times that rate, so that a channel is flat over its
/// own part of the band. A band that is not wider than a few channels is passed on as it is.
pub(super) struct Channeliser {
    /// The number of channels in the whole band; 1 if samples are passed on.
    count: usize,
    /// The number of samples that make one of a channel.
    decimation: usize,
    rate_hz: f64,
    prototype: Vec<f32>,
    fft: Arc<dyn Fft<f32>>,
    scratch: Vec<Complex32>,
    folded: Vec<Complex32>,
    /// Samples not yet behind the filter; the first `used` are done with.
    history: Vec<Complex32>,
    used: usize,
    /// Place of the next output's beginning among the folded samples.
    turn: usize,
    /// The channels wanted, as places in the transform.
    wanted: Vec<usize>,
}

impl fmt::Debug for Channeliser {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("Channeliser")
            .field("count", &self.count)
            .field("decimation", &self.decimation)
            .finish_non_exhaustive()
    }
}

impl Channeliser {
    /// Channels of about this spacing that touch the band, which is relative to the centre.
    pub(super) fn new(rate_hz: f64, spacing_hz: f64, band: [f64; 2]) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
        let count = (rate_hz / spacing_hz).floor().clamp(1.0, 1e6) as usize;
        let count = if count < 5 { 1 } else { count };
        let decimation = if count == 1 { 1 } else { (2 * count).div_ceil(3).min(count - 1) };
        let taps = if count == 1 { 0 } else { LENGTH * count };
        let mut channeliser = Self {
            count,
            decimation,
            rate_hz,
            prototype: prototype(taps, 0.5 / float(decimation)),
            fft: FftPlanner::new().plan_fft_forward(count),
            scratch: Vec::new(),
            folded: vec![Complex32::default(); count],
            history: Vec::new(),
            used: 0,
            turn: 0,
            wanted: Vec::new(),
        };
        channeliser.scratch.resize(channeliser.fft.get_inplace_scratch_len(), Complex32::default());
        let half = channeliser.spacing_hz() / 2.0;
        let mut wanted: Vec<usize> = (0..count).collect();
        if count > 1 {
            wanted.retain(|place| {
                let center = channeliser.offset_hz(*place);
                center + half > band[0] && center - half < band[1]
            });
        }
        // In the order of their frequencies.
        wanted.sort_by(|a, b| channeliser.offset_hz(*a).total_cmp(&channeliser.offset_hz(*b)));
        channeliser.wanted = wanted;
        channeliser
    }

    /// The frequencies of the channels' middles, about the centre, ascending.
    pub(super) fn centers_hz(&self) -> Vec<f64> {
        self.wanted.iter().map(|place| self.offset_hz(*place)).collect()
    }

    /// Width of the part of a channel that is its own, in hertz.
    pub(super) fn spacing_hz(&self) -> f64 {
        self.rate_hz / float(self.count)
    }

    /// Samples of a channel per second.
    pub(super) fn channel_rate_hz(&self) -> f64 {
        self.rate_hz / float(self.decimation)
    }

    /// Samples of the input in one of a channel.
    pub(super) fn decimation(&self) -> usize {
        self.decimation
    }

    /// Place of the filter's middle, in samples of the input after the first of an output.
    pub(super) fn delay(&self) -> f64 {
        if self.count == 1 { 0.0 } else { (float(self.prototype.len()) - 1.0) / 2.0 }
    }

    fn offset_hz(&self, place: usize) -> f64 {
        let signed = float(place) - if 2 * place > self.count { float(self.count) } else { 0.0 };
        signed * self.spacing_hz()
    }

    /// Forgets all samples.
    pub(super) fn reset(&mut self) {
        self.history.clear();
        (self.used, self.turn) = (0, 0);
    }

    /// Takes samples and appends each channel's output to `channels`.
    pub(super) fn push(&mut self, samples: &[Complex32], channels: &mut [Vec<Complex32>]) {
        if self.count == 1 {
            channels[0].extend_from_slice(samples);
            return;
        }
        self.history.extend_from_slice(samples);
        let taps = self.prototype.len();
        while self.used + taps <= self.history.len() {
            let input = &self.history[self.used..self.used + taps];
            self.folded.fill(Complex32::default());
            // A row of samples falls on the outputs in two pieces, as they are turned.
            let split = self.count - self.turn;
            let rows = input.chunks_exact(self.count).zip(self.prototype.chunks_exact(self.count));
            for (row, weights) in rows {
                add(&mut self.folded[self.turn..], &row[..split], &weights[..split]);
                add(&mut self.folded[..self.turn], &row[split..], &weights[split..]);
            }
            self.fft.process_with_scratch(&mut self.folded, &mut self.scratch);
            for (channel, place) in channels.iter_mut().zip(&self.wanted) {
                channel.push(self.folded[*place]);
            }
            self.used += self.decimation;
            self.turn = (self.turn + self.decimation) % self.count;
        }
        if self.used >= taps.max(1 << 14) {
            self.history.drain(..self.used);
            self.used = 0;
        }
    }
}

/// The noise's level in each channel over frequency, by ordered statistics that leave pulses and
/// carriers out (OS-CFAR: Rohling 1983).
///
/// The lower quartile of each bin over the last blocks counts; the level is the mean of the middle
/// half of these over neighbouring bins. A pulse is rare in time, a carrier in frequency.
pub(super) struct Noise {
    fft: Arc<dyn Fft<f32>>,
    scratch: Vec<Complex32>,
    window: Vec<f32>,
    /// The bins of each channel that are its own, from the lowest frequency.
    bins: Vec<Vec<usize>>,
    /// Place of each channel's first bin among all bins.
    offsets: Vec<usize>,
    /// The least level.
    least: f32,
    /// The levels of all bins in each block, and the number of frames that they are from.
    blocks: VecDeque<(Vec<f32>, usize)>,
    /// Powers of one channel, bin by bin.
    powers: Vec<Vec<f32>>,
    levels: Vec<f32>,
}

impl fmt::Debug for Noise {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Noise").field("blocks", &self.blocks.len()).finish_non_exhaustive()
    }
}

impl Noise {
    /// Windows of this many samples; of each channel the lowest and highest frequency of its own,
    /// over the channel's rate; and the least level.
    pub(super) fn new(window: usize, ranges: &[[f64; 2]], least: f64) -> Self {
        let fft = FftPlanner::new().plan_fft_forward(window);
        let scratch = vec![Complex32::default(); fft.get_inplace_scratch_len()];
        #[expect(clippy::cast_possible_truncation, reason = "samples are f32")]
        let hann =
            |n| ((1.0 - (TAU * (float(n) + 0.5) / float(window)).cos()) / 1.5_f64.sqrt()) as f32;
        // Its mean square is 1: a sum of noise has the power of one sample times their number.
        let hann: Vec<f32> = (0..window).map(hann).collect();
        let bins: Vec<Vec<usize>> = ranges.iter().map(|range| places(window, *range)).collect();
        let powers = vec![Vec::new(); bins.iter().map(Vec::len).max().unwrap_or(0)];
        let levels = vec![1.0; bins.iter().map(Vec::len).sum()];
        let offsets = bins.iter().scan(0, |sum, bins: &Vec<usize>| {
            let before = *sum;
            *sum += bins.len();
            Some(before)
        });
        let offsets = offsets.collect();
        #[expect(clippy::cast_possible_truncation, reason = "samples are f32")]
        let least = least as f32;
        Self {
            fft,
            scratch,
            window: hann,
            bins,
            offsets,
            least,
            blocks: VecDeque::new(),
            powers,
            levels,
        }
    }

    /// Takes a block of samples of all channels; one that is shorter than a few frames is left out,
    /// unless there is no other.
    pub(super) fn update(&mut self, channels: &[Vec<Complex32>], from: usize) {
        let size = self.window.len();
        let length = channels.first().map_or(0, Vec::len).saturating_sub(from);
        let frames = if length < size { 0 } else { (length - size) / (size / 2).max(1) + 1 };
        if frames == 0 || (frames < 16 && !self.blocks.is_empty()) {
            return;
        }
        let mut block = Vec::with_capacity(self.levels.len());
        let mut buffer = vec![Complex32::default(); size];
        // The mean of the r-th smallest of n exponentials is Σ 1/(n − i) (Rényi 1953).
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
        let rank = ((float(frames) * QUANTILE).ceil() as usize).clamp(1, frames);
        let expected: f64 = (0..rank).map(|i| 1.0 / float(frames - i)).sum();
        #[expect(clippy::cast_possible_truncation, reason = "samples are f32")]
        let scale = (1.0 / (expected * float(size))) as f32;
        for (channel, bins) in channels.iter().zip(&self.bins) {
            self.powers.iter_mut().for_each(Vec::clear);
            for frame in channel[from..].windows(size).step_by((size / 2).max(1)) {
                for ((value, sample), weight) in buffer.iter_mut().zip(frame).zip(&self.window) {
                    *value = sample * weight;
                }
                self.fft.process_with_scratch(&mut buffer, &mut self.scratch);
                for (bin, powers) in bins.iter().zip(&mut self.powers) {
                    powers.push(buffer[*bin].norm_sqr());
                }
            }
            for powers in &mut self.powers[..bins.len()] {
                let (_, level, _) = powers.select_nth_unstable_by(rank - 1, f32::total_cmp);
                block.push(*level * scale);
            }
        }
        if self.blocks.len() == BLOCKS {
            self.blocks.pop_front();
        }
        self.blocks.push_back((block, frames));
        self.smooth();
    }

    /// Returns true if any block was measured.
    pub(super) fn is_known(&self) -> bool {
        !self.blocks.is_empty()
    }

    fn smooth(&mut self) {
        let total: usize = self.blocks.iter().map(|(_, frames)| frames).sum();
        let mut mean = vec![0.0_f32; self.levels.len()];
        for (block, frames) in &self.blocks {
            #[expect(clippy::cast_possible_truncation, reason = "samples are f32")]
            let share = (float(*frames) / float(total)) as f32;
            mean.iter_mut().zip(block).for_each(|(sum, level)| *sum += share * level);
        }
        let count = mean.len();
        let width = (2 * NEIGHBOURS + 1).min(count);
        let mut near = Vec::with_capacity(width);
        for (bin, level) in self.levels.iter_mut().enumerate() {
            // At the ends the window is as long, one-sided.
            let first = bin.saturating_sub(NEIGHBOURS).min(count - width);
            near.clear();
            near.extend_from_slice(&mean[first..first + width]);
            near.sort_unstable_by(f32::total_cmp);
            let middle = &near[width / 4..width - width / 4];
            #[expect(clippy::cast_precision_loss, reason = "a few bins")]
            let average = middle.iter().sum::<f32>() / middle.len() as f32;
            *level = average.max(self.least);
        }
    }

    /// The number of exponentials that the level is worth.
    ///
    /// The lower quartile of n exponentials has the relative variance 4.03/n; frames of Hann's
    /// window that overlap by half are worth 0.8 each, a bin 1/1.5 of one and the mean of the
    /// middle half 0.85 of that of all.
    pub(super) fn known(&self) -> f64 {
        let frames: usize = self.blocks.iter().map(|(_, frames)| frames).sum();
        let bins = float((2 * NEIGHBOURS + 1).min(self.levels.len()));
        (0.8 * float(frames) * (0.85 * bins / 1.5).max(1.0) / 4.03).max(4.0)
    }

    /// The levels of all bins now, for [`Noise::level_of`].
    pub(super) fn levels(&self) -> &[f32] {
        &self.levels
    }

    /// The noise's power in a sample of a channel at each of these frequencies, over its rate.
    pub(super) fn level(&self, channel: usize, frequency: f64) -> f32 {
        self.level_of(&self.levels, channel, frequency)
    }

    /// The noise's power in a sample by levels at another time.
    pub(super) fn level_of(&self, levels: &[f32], channel: usize, frequency: f64) -> f32 {
        let before = self.offsets[channel];
        let bins = &self.bins[channel];
        let Some(first) = bins.first() else { return 1.0 };
        let size = float(self.window.len());
        let place = (frequency - signed(*first, self.window.len())) * size;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let place = place.round().clamp(0.0, float(bins.len() - 1)) as usize;
        levels[before + place]
    }
}

fn add(sums: &mut [Complex32], samples: &[Complex32], weights: &[f32]) {
    for ((sum, sample), weight) in sums.iter_mut().zip(samples).zip(weights) {
        *sum += sample * weight;
    }
}

/// A low pass of Kaiser's window with gain 1, its cut-off in cycles per sample.
fn prototype(taps: usize, cutoff: f64) -> Vec<f32> {
    let middle = (float(taps) - 1.0) / 2.0;
    let weight = |n: usize| {
        let x = float(n) - middle;
        let sinc =
            if x.abs() < 1e-9 { 2.0 * cutoff } else { (2.0 * PI * cutoff * x).sin() / (PI * x) };
        let window = bessel_i0(KAISER_BETA * (1.0 - (x / (middle + 0.5)).powi(2)).max(0.0).sqrt());
        sinc * window
    };
    let weights: Vec<f64> = (0..taps).map(weight).collect();
    let gain: f64 = weights.iter().sum();
    #[expect(clippy::cast_possible_truncation, reason = "samples are f32")]
    let weights = weights.iter().map(|weight| (weight / gain) as f32).collect();
    weights
}

/// The modified Bessel function of order 0, by its series.
pub(super) fn bessel_i0(x: f64) -> f64 {
    let mut term = 1.0;
    let mut sum = 1.0;
    for k in 1..40 {
        term *= (x / 2.0 / f64::from(k)).powi(2);
        sum += term;
    }
    sum
}

#[expect(clippy::cast_precision_loss, reason = "counts of samples are below 2^52")]
pub(super) fn float(count: usize) -> f64 {
    count as f64
}

/// A bin's frequency over the rate, −1/2 to 1/2.
pub(super) fn signed(bin: usize, size: usize) -> f64 {
    let turns = float(bin) / float(size);
    if 2 * bin >= size { turns - 1.0 } else { turns }
}

/// The bins of a transform of this size within a range of frequencies over the rate, ascending;
/// at least one.
pub(super) fn places(size: usize, [low, high]: [f64; 2]) -> Vec<usize> {
    let mut bins: Vec<usize> = (0..size).collect();
    bins.sort_by(|a, b| signed(*a, size).total_cmp(&signed(*b, size)));
    let middle = (low + high) / 2.0;
    let nearest = |a: &usize, b: &usize| {
        (signed(*a, size) - middle).abs().total_cmp(&(signed(*b, size) - middle).abs())
    };
    let fallback = bins.iter().copied().min_by(nearest);
    bins.retain(|bin| (low..=high).contains(&signed(*bin, size)));
    if bins.is_empty() {
        bins.extend(fallback);
    }
    bins
}

/// The size of the transform of a window: bins of half its inverse length or a little less.
pub(super) fn transform_size(length: usize) -> usize {
    (2 * length..).find(|size| smooth(*size)).unwrap_or(2 * length)
}

/// Returns true if a transform of this size is quick: even, of small factors.
fn smooth(mut size: usize) -> bool {
    if !size.is_multiple_of(2) {
        return false;
    }
    for factor in [2, 3, 5] {
        while size.is_multiple_of(factor) {
            size /= factor;
        }
    }
    size == 1
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    #[expect(clippy::cast_possible_truncation, reason = "samples are f32")]
    fn tone(rate_hz: f64, hz: f64, count: usize) -> Vec<Complex32> {
        let sample =
            |n: usize| Complex32::from_polar(1.0, (TAU * (hz / rate_hz * float(n)).fract()) as f32);
        (0..count).map(sample).collect()
    }

    #[test]
    fn a_tone_is_in_its_channel_alone() {
        let rate = 100e3;
        for hz in [0.0, 1_900.0, -31_000.0, 49_000.0] {
            let mut channeliser = Channeliser::new(rate, 4e3, [-50e3, 50e3]);
            let centers = channeliser.centers_hz();
            assert_eq!(centers.len(), 25);
            let mut channels = vec![Vec::new(); centers.len()];
            for chunk in tone(rate, hz, 20_000).chunks(777) {
                channeliser.push(chunk, &mut channels);
            }
            let channel_rate = channeliser.channel_rate_hz();
            for (center, channel) in centers.iter().zip(&channels) {
                assert!(channel.len() > 1000);
                // What is left after turning the tone back to 0, over the channel's own rate.
                let power = channel.iter().map(|x| f64::from(x.norm_sqr())).sum::<f64>();
                let level = 10.0 * (power / float(channel.len())).log10();
                let away = (hz - center).abs().min(rate - (hz - center).abs());
                if away <= 2e3 {
                    assert!(level.abs() < 0.1, "{hz} in {center}: {level} dB");
                    let step = TAU * (hz - center) / channel_rate;
                    let turned = (channel[101] * channel[100].conj()).arg();
                    let off = (f64::from(turned) - step).rem_euclid(TAU);
                    assert!(off.min(TAU - off) < 1e-3, "{hz} in {center}: {turned} {step}");
                } else if away > 3.9e3 {
                    assert!(level < -60.0, "{hz} in {center}: {level} dB");
                }
            }
        }
    }

    #[test]
    fn only_channels_of_the_band_are_made() {
        let channeliser = Channeliser::new(100e3, 4e3, [9e3, 15e3]);
        assert_eq!(channeliser.centers_hz(), [8e3, 12e3, 16e3]);
        assert_eq!(Channeliser::new(8e3, 4e3, [-1e3, 1e3]).centers_hz(), [0.0]);
    }
}
