use std::{
    f64::consts::{LN_2, TAU},
    ops::Range,
};

use rustfft::num_complex::{Complex32, Complex64};

use super::channeliser::float;

/// Samples of a channel, and the noise's power in each.
#[derive(Debug, Clone, Copy)]
pub(super) struct View<'a> {
    pub(super) samples: &'a [Complex32],
    pub(super) noise: f64,
}

/// A stretch of a channel at one frequency.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Peak {
    pub(super) start: usize,
    pub(super) length: usize,
    /// Over the channel's rate.
    pub(super) frequency: f64,
    /// Over the noise's power density: exponential with mean 1 where there is noise alone.
    pub(super) energy: f64,
}

/// What a change of both ends must win, in units of the noise, as two numbers are fitted.
const EDGES_WORTH: f64 = 2.5;
/// Reference cells on each side.
const REFERENCES: usize = 8;
/// Above this, a median of reference cells is not noise: one of seven is with probability 0.002.
const LIT: f64 = 2.5;
/// The same where there are fewer cells: of five with probability 6e-5.
const LIT_FEW: f64 = 4.0;

impl View<'_> {
    pub(super) fn energy(&self, start: usize, length: usize, frequency: f64) -> f64 {
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
    pub(super) fn sums(&self, from: usize, to: usize, frequency: f64) -> Vec<Complex64> {
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
    pub(super) fn refine(&self, start: usize, length: usize, hop: usize, frequency: f64) -> Peak {
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
    pub(super) fn with_edges(&self, peak: Peak, shortest: usize, limits: &Range<usize>) -> Peak {
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
            let (mut a, mut b) = (best.start - from, best.start + best.length - from);
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

    /// Whether it goes on beyond both ends, or, where that is clear, beyond one: then it is part of
    /// something longer than the bank's windows. What is beyond the limits is another pulse.
    pub(super) fn goes_on(&self, peak: &Peak, limits: &Range<usize>) -> bool {
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

    /// What is left of a peak's energy over what its bin holds at other times (OS-CFAR: Rohling
    /// 1983): where the median there is above that of noise there is a carrier, and only the
    /// amplitude above the carrier's counts.
    pub(super) fn above_carrier(&self, peak: &Peak) -> f64 {
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

    /// What a stretch holds.
    pub(super) fn energy_of(&self, peak: &Peak) -> f64 {
        self.energy(peak.start, peak.length, peak.frequency)
    }
}

/// Where to look for what is on air beside a peak, at its time and at other frequencies of its
/// channel.
///
/// A rectangular pulse has zeros at multiples of its inverse length. A channel is flat over two
/// thirds of its rate.
pub(super) fn beside(peak: &Peak) -> impl Iterator<Item = Peak> {
    let length = float(peak.length);
    let step = (length / (3.0 * float(REFERENCES))).floor().max(1.0) / length;
    let steps = (1..=REFERENCES).flat_map(|m| [-1.0, 1.0].map(|sign| sign * (float(m) + 1.0)));
    let peak = *peak;
    steps
        .map(move |steps| Peak { frequency: peak.frequency + steps * step, ..peak })
        .filter(|cell| cell.frequency.abs() < 0.34)
}

/// What a statistic is worth over cells beside it. Where their median is that of noise, itself;
/// otherwise there is a burst over all frequencies, which is its noise, of a level that so few
/// cells give: an exponential over the mean of k has (1 + x/k)^−k where one over its own level has
/// e^−x. A median of 2k is worth about k.
pub(super) fn over_burst(statistic: f64, cells: &mut [f64]) -> f64 {
    let known = 0.5 * float(cells.len());
    let lit = if cells.len() < 12 { LIT_FEW } else { LIT };
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
