use std::{collections::VecDeque, f64::consts::TAU, fmt, sync::Arc};

use rustfft::{Fft, FftPlanner, num_complex::Complex32};

use super::channeliser::float;

/// The quantile of a bin's powers that is taken for its level: pulses may last three quarters of
/// the time.
const QUANTILE: f64 = 0.25;
/// The number of blocks that are remembered.
const BLOCKS: usize = 4;
/// The number of bins on each side that are looked at.
const NEIGHBOURS: usize = 10;

/// The noise's level in each channel over frequency, by ordered statistics that leave pulses and
/// carriers out (OS-CFAR: Rohling 1983).
///
/// Of each bin the lower quartile over time counts, over the last blocks; of that the mean of the
/// middle half over neighbouring bins. A pulse is rare in time, a carrier in frequency.
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
