use std::{fmt, mem, ops::Range, sync::Arc};

use rustfft::{Fft, FftPlanner, num_complex::Complex32};

use super::{
    channeliser::float,
    noise::{Noise, places, signed},
};

/// A place in time, frequency and width that may be a pulse.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    pub(super) channel: usize,
    /// Index of the window in the bank.
    pub(super) width: usize,
    /// The window's first sample, as the channel counts.
    pub(super) start: u64,
    /// Frequency about the channel's middle, over its rate.
    pub(super) frequency: f64,
    /// Energy over the noise's power density.
    pub(super) energy: f32,
}

/// One window of the bank: rectangular, as long as a pulse, begun every quarter of its length,
/// in bins of half its inverse length.
pub(super) struct Window {
    pub(super) length: usize,
    pub(super) hop: usize,
    fft: Arc<dyn Fft<f32>>,
    scratch: Vec<Complex32>,
    buffer: Vec<Complex32>,
    /// The bins of each channel that are its own and one more on each side, ascending.
    bins: Vec<Vec<usize>>,
    /// The bins of each channel as contiguous ranges of the transform.
    runs: Vec<Vec<Range<usize>>>,
    /// The first frame not yet looked at, as the channels count.
    pub(super) next: u64,
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
pub(super) struct Stretch<'a> {
    pub(super) channel: usize,
    pub(super) samples: &'a [Complex32],
    /// The first sample's index, as the channel counts.
    pub(super) origin: u64,
    /// True if nothing follows.
    pub(super) last: bool,
}

impl Window {
    /// A window of this many samples; of each channel the range of frequencies over its rate.
    pub(super) fn new(length: usize, ranges: &[[f64; 2]]) -> Self {
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
    pub(super) fn advance(&mut self, end: u64, last: bool) {
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
    pub(super) fn screen(
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
}
