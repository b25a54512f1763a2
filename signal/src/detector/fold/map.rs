use std::{f64::consts::LN_2, fmt, sync::Arc};

use rustfft::{Fft, FftPlanner, num_complex::Complex32};

use super::super::channeliser::{float, signed, transform_size};

/// A frame or a bin is lit by something that is no pulse where its median is above that of noise by
/// this factor: a burst over all frequencies, of at least 64 bins (3.5 σ), and a carrier (2.5 σ and
/// more, with the hundreds of frames that a train has).
const LIT_FRAME: f32 = 1.6;
const LIT_BIN: f32 = 1.12;
const FEWEST_BINS: usize = 64;
const FEWEST_FRAMES: usize = 200;
/// Energy above which a cell's leakage to other frequencies counts, over the level of its frame: in
/// a burst over all frequencies no cell stands out so far.
const STRONG: f32 = 30.0;
/// Factor by which a cell must be above what may leak there: pulses have no exact shape.
const MARGIN: f32 = 4.0;

/// The energies of pulse-long windows in a channel, over frequency and time: each over the noise's
/// power density, exponential with mean 1 where there is noise alone.
///
/// Windows begin every quarter of their length, in bins of half its inverse. Bursts over all
/// frequencies and carriers are divided away (their frame's or bin's own median, as in OS-CFAR:
/// Rohling 1983), and what may leak from strong cells counts as noise. No single cell counts for
/// more than about the ceiling, so that a strong pulse or two make no train.
pub(super) struct Map {
    pub length: usize,
    pub hop: usize,
    fft: Arc<dyn Fft<f32>>,
    scratch: Vec<Complex32>,
    buffer: Vec<Complex32>,
    /// The places in the transform, by frequency.
    order: Vec<usize>,
    /// The frequency of each, over the channel's rate.
    pub frequencies: Vec<f64>,
    ceiling: f32,
    /// The number of frames.
    pub frames: usize,
    /// Frame by frame while it is filled.
    cells: Vec<f32>,
    /// The share of each cell that counts.
    shares: Vec<f32>,
    bounds: Vec<f32>,
    /// Bin by bin.
    rows: Vec<f32>,
}

impl fmt::Debug for Map {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Map").field("length", &self.length).finish_non_exhaustive()
    }
}

impl Map {
    /// A map of windows of this many samples.
    pub(super) fn new(length: usize, ceiling: f64) -> Self {
        let size = transform_size(length);
        let fft = FftPlanner::new().plan_fft_forward(size);
        let mut order: Vec<usize> = (0..size).collect();
        order.sort_by(|a, b| signed(*a, size).total_cmp(&signed(*b, size)));
        #[expect(clippy::cast_possible_truncation, reason = "energies are f32")]
        let ceiling = ceiling as f32;
        Self {
            length,
            hop: (length / 4).max(1),
            scratch: vec![Complex32::default(); fft.get_inplace_scratch_len()],
            fft,
            buffer: vec![Complex32::default(); size],
            frequencies: order.iter().map(|bin| signed(*bin, size)).collect(),
            order,
            ceiling,
            frames: 0,
            cells: Vec::new(),
            shares: Vec::new(),
            bounds: Vec::new(),
            rows: Vec::new(),
        }
    }

    /// The distance of bins, over the channel's rate.
    pub(super) fn bin(&self) -> f64 {
        1.0 / float(self.order.len())
    }

    /// Fills it from samples; `level` gives the noise's power at a sample's place and a frequency,
    /// the same for as many frames as it returns.
    pub(super) fn fill(
        &mut self,
        samples: &[Complex32],
        mut levels: impl FnMut(usize, &[f64], &mut Vec<f32>) -> usize,
    ) {
        let bins = self.order.len();
        self.cells.clear();
        self.frames = 0;
        let mut weights = Vec::new();
        let mut until = 0;
        for (place, frame) in samples
            .windows(self.length)
            .step_by(self.hop)
            .enumerate()
            .map(|(n, f)| (n * self.hop, f))
        {
            if place >= until {
                until = levels(place, &self.frequencies, &mut weights).max(place + 1);
                for weight in &mut weights {
                    #[expect(clippy::cast_precision_loss, reason = "a window's length")]
                    let length = self.length as f32;
                    *weight = 1.0 / (*weight * length);
                }
            }
            self.buffer[..frame.len()].copy_from_slice(frame);
            self.buffer[frame.len()..].fill(Complex32::default());
            self.fft.process_with_scratch(&mut self.buffer, &mut self.scratch);
            let cells = self.order.iter().zip(&weights);
            self.cells.extend(cells.map(|(bin, weight)| self.buffer[*bin].norm_sqr() * weight));
            self.frames += 1;
        }
        self.shares.clear();
        self.shares.resize(self.cells.len(), 1.0);
        self.leave_out_leakage();
        self.leave_out_bursts();
        self.rows.clear();
        for bin in 0..bins {
            let shares = self.shares.iter().skip(bin).step_by(bins);
            let cells = self.cells.iter().skip(bin).step_by(bins);
            self.rows.extend(cells.zip(shares).map(|(cell, share)| cell * share));
        }
        self.leave_out_carriers();
        let ceiling = self.ceiling;
        self.rows.iter_mut().for_each(|cell| *cell = limited(*cell, ceiling));
    }

    /// The energies of a bin over time, limited.
    pub(super) fn row(&self, bin: usize) -> &[f32] {
        &self.rows[bin * self.frames..(bin + 1) * self.frames]
    }

    /// The share of the energy at a frame and a frequency that counts.
    pub(super) fn share(&self, frame: f64, frequency: f64) -> f64 {
        let near = |x: f64, count: usize| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let place = x.round().clamp(0.0, float(count.saturating_sub(1))) as usize;
            place
        };
        let bins = self.order.len();
        let bin = near((frequency - self.frequencies[0]) / self.bin(), bins);
        let place = near(frame, self.frames) * bins + bin;
        self.shares.get(place).map_or(1.0, |share| f64::from(*share))
    }

    /// A tone on air for a window of n samples has at most E/(π Δ n)² at a distance Δ in any window
    /// that overlaps it.
    fn leave_out_leakage(&mut self) {
        let bins = self.order.len();
        if self.cells.iter().all(|cell| *cell < STRONG) {
            return;
        }
        self.bounds.clear();
        self.bounds.resize(self.cells.len(), 0.0);
        #[expect(clippy::cast_possible_truncation, reason = "energies are f32")]
        let scale = (1.0 / (std::f64::consts::PI * float(self.length) * self.bin()).powi(2)) as f32;
        let main_lobe = bins.div_ceil(self.length);
        let mut sorted = Vec::with_capacity(bins);
        for (frame, cells) in self.cells.chunks_exact(bins).enumerate() {
            if cells.iter().all(|cell| *cell < STRONG) {
                continue;
            }
            sorted.clear();
            sorted.extend_from_slice(cells);
            let level = if bins < FEWEST_BINS { 1.0 } else { over_noise(&mut sorted).max(1.0) };
            let strong = STRONG * level;
            for (bin, cell) in cells.iter().enumerate().filter(|(_, cell)| **cell >= strong) {
                let near = bin.saturating_sub(1)..(bin + 2).min(bins);
                if cells[near].iter().any(|other| other > cell) {
                    continue;
                }
                // Windows of up to a length before and after hold a part of it.
                let first = frame.saturating_sub(4);
                let last = (frame + 4).min(self.frames - 1);
                for bounds in self.bounds[first * bins..(last + 1) * bins].chunks_exact_mut(bins) {
                    for (other, bound) in bounds.iter_mut().enumerate() {
                        let away = other.abs_diff(bin);
                        if away >= main_lobe {
                            #[expect(clippy::cast_precision_loss, reason = "a count of bins")]
                            let away = away as f32;
                            *bound = bound.max(cell * scale / (away * away));
                        }
                    }
                }
            }
        }
        let cells = self.cells.iter().zip(&self.bounds);
        for (share, (cell, bound)) in self.shares.iter_mut().zip(cells) {
            if *cell < MARGIN * bound {
                *share = (1.0 / cell).min(1.0);
            } else if *bound > 0.0 {
                *share = 1.0 - bound / cell;
            }
        }
    }

    fn leave_out_bursts(&mut self) {
        let bins = self.order.len();
        if bins < FEWEST_BINS {
            return;
        }
        let mut sorted = Vec::with_capacity(bins);
        let frames = self.cells.chunks_exact(bins).zip(self.shares.chunks_exact_mut(bins));
        for (cells, shares) in frames {
            sorted.clear();
            sorted.extend(cells.iter().zip(&*shares).map(|(cell, share)| cell * share));
            let level = over_noise(&mut sorted);
            if level > LIT_FRAME {
                shares.iter_mut().for_each(|share| *share /= level);
            }
        }
    }

    fn leave_out_carriers(&mut self) {
        if self.frames < FEWEST_FRAMES {
            return;
        }
        let bins = self.order.len();
        let mut sorted = Vec::with_capacity(self.frames);
        for (bin, row) in self.rows.chunks_exact_mut(self.frames).enumerate() {
            sorted.clear();
            sorted.extend_from_slice(row);
            let level = over_noise(&mut sorted);
            if level > LIT_BIN {
                row.iter_mut().for_each(|cell| *cell /= level);
                let shares = self.shares.iter_mut().skip(bin).step_by(bins);
                shares.for_each(|share| *share /= level);
            }
        }
    }
}

/// The median over that of exponentials with mean 1.
fn over_noise(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    let (_, median, _) = values.select_nth_unstable_by(middle, f32::total_cmp);
    #[expect(clippy::cast_possible_truncation, reason = "energies are f32")]
    let of_noise = LN_2 as f32;
    *median / of_noise
}

/// Compresses energies above the ceiling logarithmically; the order is kept.
pub(super) fn limited(energy: f32, ceiling: f32) -> f32 {
    if energy <= ceiling { energy } else { ceiling * (1.0 + 0.05 * (energy / ceiling).ln()) }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    const LENGTH: usize = 64;
    const HOP: usize = LENGTH / 4;

    /// 400 frames of noise of power 1.
    fn noise(seed: u64) -> Vec<Complex32> {
        let mut generator = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut part = || {
            let value: f32 = StandardNormal.sample(&mut generator);
            value * 0.5_f32.sqrt()
        };
        (0..400 * HOP).map(|_| Complex32::new(part(), part())).collect()
    }

    fn filled(samples: &[Complex32]) -> Map {
        let mut map = Map::new(LENGTH, 1e6);
        map.fill(samples, |_, frequencies, levels| {
            levels.resize(frequencies.len(), 1.0);
            usize::MAX
        });
        map
    }

    fn mean(values: impl Iterator<Item = f32>) -> f32 {
        let values: Vec<f32> = values.collect();
        #[expect(clippy::cast_precision_loss, reason = "some thousands")]
        let count = values.len() as f32;
        values.iter().sum::<f32>() / count
    }

    /// Noise ten times as strong over all frequencies for 40 frames: they count as noise, in what
    /// is folded and in what is refined; the others as they were.
    #[test]
    fn bursts_are_divided_away() {
        let mut samples = noise(1);
        samples[100 * HOP..140 * HOP].iter_mut().for_each(|sample| *sample *= 10_f32.sqrt());
        let map = filled(&samples);
        let bins = map.frequencies.len();
        let of = |frames: std::ops::Range<usize>| {
            mean((0..bins).flat_map(|bin| map.row(bin)[frames.clone()].iter().copied()))
        };
        // 36 frames of 128 bins, of which one in eight is independent: σ of the mean is 0.04.
        let burst = of(102..136);
        let rest = of(0..90);
        assert_abs_diff_eq!(burst, 1.0, epsilon = 0.15);
        assert_abs_diff_eq!(rest, 1.0, epsilon = 0.1);
        let shares = mean((102..136).map(|frame| {
            #[expect(clippy::cast_possible_truncation, reason = "a share")]
            let share = map.share(float(frame), 0.2) as f32;
            share
        }));
        assert_abs_diff_eq!(shares, 0.1, epsilon = 0.02);
        assert_abs_diff_eq!(map.share(50.0, 0.2), 1.0, epsilon = 1e-6);
    }

    /// A carrier of energy 8 in a window: its bins are noise at all times, others as they were.
    #[test]
    fn carriers_are_divided_away() {
        let mut samples = noise(2);
        #[expect(clippy::cast_possible_truncation, reason = "samples are f32")]
        let carrier = |n: usize| {
            let angle = std::f64::consts::TAU * 0.125 * float(n);
            Complex32::from_polar((8.0 / float(LENGTH)).sqrt() as f32, angle as f32)
        };
        samples.iter_mut().enumerate().for_each(|(n, sample)| *sample += carrier(n));
        let map = filled(&samples);
        let bin = |frequency: f64| {
            let near =
                |a: &&f64, b: &&f64| (**a - frequency).abs().total_cmp(&(**b - frequency).abs());
            let nearest = map.frequencies.iter().min_by(near);
            map.frequencies.iter().position(|f| Some(f) == nearest).expect("there are bins")
        };
        // Energy 9 in the mean, of a median that is higher than that of noise as it scatters less.
        let lit = mean(map.row(bin(0.125)).iter().copied());
        assert!((0.6..1.1).contains(&lit), "{lit}");
        let dark = mean(map.row(bin(-0.2)).iter().copied());
        assert_abs_diff_eq!(dark, 1.0, epsilon = 0.25);
        let share = map.share(200.0, 0.125);
        assert!((0.07..0.12).contains(&share), "{share}");
        assert_abs_diff_eq!(map.share(200.0, -0.2), 1.0, epsilon = 0.2);
    }
}
