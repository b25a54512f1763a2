//! The fold of a map over all intervals, and the rate at which noise alone gives a train.

use std::{f64::consts::PI, mem};

use super::super::{channeliser::float, config::discrete};

/// Cells of the distribution below the ceiling.
const CELLS: usize = 100;

/// The share of the trials that counting gives for steps of the interval: they are not independent
/// of steps in time. Calibrated once for 5 and 10 pulses, an interval that is known or within 2 %;
/// the tests count on other noise.
const COUNTED: f64 = 0.8;

/// The ceiling over what a pulse has at the threshold: more than two thirds of a train's pulses
/// must be there.
const CEILING: f64 = 1.4;

/// Adds up the energies of pulses at all starts and intervals (fast folding, Staelin 1969).
///
/// The sum of many pulses is that of its first half and its second, and sums of few pulses serve
/// many intervals: they need coarser steps of it. Intervals count in frames.
#[derive(Debug)]
pub(super) struct Comb {
    /// The intervals, ascending; the last pulse is a frame later from one to the next.
    pub intervals: Vec<f64>,
    /// Sums of as many pulses as the whole and as its parts, the most first; the last are of one
    /// pulse.
    parts: Vec<Part>,
}

/// Sums of some pulses.
#[derive(Debug, Default)]
struct Part {
    pulses: usize,
    /// Steps of the interval.
    step: f64,
    /// The parts that it is the sum of.
    first: usize,
    second: usize,
    /// The interval in steps that the sums are of.
    held: Option<u64>,
    sums: Vec<f32>,
}

impl Comb {
    /// A comb of `pulses` pulses, at intervals between these, in frames.
    pub(super) fn new(pulses: usize, [shortest, longest]: [f64; 2]) -> Self {
        let step = 1.0 / float(pulses - 1);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
        let steps = ((longest - shortest) / step).ceil().max(0.0) as usize;
        let interval = |n: usize| {
            let share = if steps == 0 { 0.0 } else { float(n) / float(steps) };
            shortest + share * (longest - shortest)
        };
        let mut counts = vec![pulses];
        let mut next = 0;
        while let Some(count) = counts.get(next).copied() {
            for half in [count.div_ceil(2), count / 2] {
                if count > 1 && !counts.contains(&half) {
                    counts.push(half);
                }
            }
            next += 1;
        }
        counts.sort_unstable_by(|a, b| b.cmp(a));
        let place = |count: usize| counts.iter().position(|c| *c == count).unwrap_or(0);
        let parts = counts.iter().map(|count| Part {
            pulses: *count,
            // The last pulse is half a frame later from one to the next.
            step: 0.5 / float(count.saturating_sub(1).max(1)),
            first: place(count.div_ceil(2)),
            second: place(count / 2),
            ..Part::default()
        });
        Self { intervals: (0..=steps).map(interval).collect(), parts: parts.collect() }
    }

    /// Gives each sum above the threshold, with the interval's place and the start, of a row of
    /// energies and of starts below a number.
    pub(super) fn fold(
        &mut self,
        row: &[f32],
        starts: usize,
        threshold: f32,
        mut above: impl FnMut(usize, usize, f32),
    ) {
        self.parts.iter_mut().for_each(|part| part.held = None);
        for place in 0..self.intervals.len() {
            let interval = self.intervals[place];
            let first = self.parts[0].first;
            let second = self.parts[0].second;
            self.prepare(first, interval, row);
            self.prepare(second, interval, row);
            let shift = frames(float(self.parts[first].pulses) * interval);
            let early = self.sums(first, row);
            let early = &early[..early.len().min(starts)];
            let late = self.sums(second, row).get(shift..).unwrap_or(&[]);
            let chunks = early.chunks(64).zip(late.chunks(64)).enumerate();
            for (chunk, (early, late)) in chunks {
                let sums = || early.iter().zip(late).map(|(a, b)| a + b);
                // Nearly all chunks end here; a count is quicker than a maximum.
                if sums().map(|sum| u32::from(sum > threshold)).sum::<u32>() == 0 {
                    continue;
                }
                for (start, sum) in sums().enumerate().filter(|(_, sum)| *sum > threshold) {
                    above(place, 64 * chunk + start, sum);
                }
            }
        }
    }

    fn sums<'a>(&'a self, part: usize, row: &'a [f32]) -> &'a [f32] {
        let part = &self.parts[part];
        if part.pulses == 1 { row } else { &part.sums }
    }

    /// Makes a part hold the sums of the interval nearest to this one.
    fn prepare(&mut self, part: usize, interval: f64, row: &[f32]) {
        let Part { pulses, step, first, second, held, .. } = self.parts[part];
        if pulses == 1 {
            return;
        }
        let steps = (interval / step).round();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive")]
        let wanted = Some(steps as u64);
        if held == wanted {
            return;
        }
        let interval = steps * step;
        self.prepare(first, interval, row);
        self.prepare(second, interval, row);
        let shift = frames(float(self.parts[first].pulses) * interval);
        let mut sums = mem::take(&mut self.parts[part].sums);
        sums.clear();
        let late = self.sums(second, row).get(shift..).unwrap_or(&[]);
        sums.extend(self.sums(first, row).iter().zip(late).map(|(a, b)| a + b));
        self.parts[part].sums = sums;
        self.parts[part].held = wanted;
    }
}

/// The places that a search for trains goes over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Trials {
    /// The number of pulses that are added up.
    pub pulses: usize,
    pub band_hz: f64,
    /// Samples of a window, and how many of them starts are apart.
    pub length: usize,
    pub step: usize,
    /// The number of intervals; the last pulse is a quarter of a window later from one to the next.
    pub intervals: usize,
    /// The drifts times what pulses are apart from the middle of a train in the mean square,
    /// times a window's length: turns by which drifts differ.
    pub drifts: f64,
}

/// The rate at which noise alone gives a train.
///
/// The statistic is the sum of K energies, each exponential with mean 1 under noise and limited by
/// a ceiling. Its distribution at one place is the K-fold convolution, averaged over the error of
/// the noise's level, a Γ variable of k degrees. Maxima over a field of such places come at the
/// rate P(S > T) times the rates at which the field decorrelates, h the distribution's decay: in
/// time 2h(T − K)/w a second (rough: Pickands 1969), less by ν(h√(4T/n)) as windows begin n to
/// a length only (Siegmund 1985); in frequency h√(πT/3) w a hertz (smooth: Rice 1944); over
/// drifts alike; an interval's step moves pulses as a step in time does, x² = h² 4T times the
/// mean of their shifts over w, and counts for ½x²ν(x) trials. Without the ceiling and for K = 1
/// that is the rate of single pulses.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TrainAlarms {
    trials: Trials,
    pub ceiling: f64,
    /// ln P(S > x) each step of x, from `first` on.
    ln_tail: Vec<f64>,
    first: f64,
    step: f64,
}

impl TrainAlarms {
    /// The alarms with the ceiling for about `rate_hz` false alarms a second.
    pub(super) fn new(trials: Trials, rate_hz: f64) -> Self {
        let known = 1000.0;
        // An energy beyond the reach of noise is no ceiling.
        let open = Self::below(trials, 60.0);
        let ceiling = CEILING * open.threshold(rate_hz, known) / float(trials.pulses);
        Self::below(trials, ceiling)
    }

    fn below(trials: Trials, ceiling: f64) -> Self {
        let step = ceiling / float(CELLS);
        let mut one: Vec<f64> =
            (0..=CELLS).map(|n| (-float(n) * step).exp() * -(-step).exp_m1()).collect();
        // What reaches the ceiling lies at the border of the last two cells.
        let beyond = (-ceiling).exp();
        one[CELLS] = 0.5 * beyond;
        one[CELLS - 1] += 0.5 * beyond;
        let mut sums = one.clone();
        for _ in 1..trials.pulses {
            let mut next = vec![0.0; sums.len() + CELLS];
            for (n, a) in sums.iter().enumerate() {
                next[n..].iter_mut().zip(&one).for_each(|(sum, b)| *sum += a * b);
            }
            sums = next;
        }
        let mut tail = 0.0;
        for value in sums.iter_mut().rev() {
            tail += *value;
            *value = tail.ln();
        }
        // A cell stands for its middle, and its sum for what is above its lower border.
        let first = 0.5 * float(trials.pulses - 1) * step;
        Self { trials, ceiling, ln_tail: sums, first, step }
    }

    fn ln_tail(&self, x: f64) -> f64 {
        let place = ((x - self.first) / self.step).max(0.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive")]
        let cell = place as usize;
        match self.ln_tail.get(cell..cell + 2) {
            Some([a, b]) => a + (b - a) * (place - float(cell)),
            _ => f64::NEG_INFINITY,
        }
    }

    /// The logarithm of the probability at one place, where the noise's level is worth `known`
    /// exponentials.
    fn ln_beyond(&self, threshold: f64, known: f64) -> f64 {
        // Over the logarithm of the level's error.
        let nodes = (-32..=32).map(|n| f64::from(n) / 4.0 / known.sqrt());
        let mut sum = 0.0;
        let mut weights = 0.0;
        for u in nodes {
            let weight = (known * (u - u.exp_m1())).exp();
            weights += weight;
            sum += weight * self.ln_tail(threshold * u.exp()).exp();
        }
        (sum / weights).ln()
    }

    /// The number of noise's trains above the threshold, a second.
    pub(super) fn rate_hz(&self, threshold: f64, known: f64) -> f64 {
        let Trials { pulses, band_hz, length, step, intervals, drifts } = self.trials;
        let ln_beyond = self.ln_beyond(threshold, known);
        if ln_beyond == f64::NEG_INFINITY {
            return 0.0;
        }
        let decay = (self.ln_tail(threshold - 0.25) - self.ln_tail(threshold + 0.25)) / 0.5;
        let decay = if decay.is_finite() { decay } else { 1.0 };
        let above = (threshold - float(pulses)).max(1.0);
        let in_time = |x: f64| discrete(decay * (4.0 * threshold * x).sqrt());
        let time = 2.0 * decay * above * in_time(float(step) / float(length));
        let turns = decay * (PI * threshold / 3.0).sqrt();
        let middle = (float(pulses) - 1.0) / 2.0;
        let shift = (0..pulses).map(|n| (float(n) - middle).abs()).sum::<f64>() / float(pulses);
        let apart = shift / (4.0 * float(pulses - 1));
        let each = 0.5 * decay * decay * 4.0 * threshold * apart * in_time(apart);
        // Refining goes a step beyond the first and the last.
        let intervals = 1.0 + COUNTED * each * float(intervals + 1);
        let drifts = 1.0 + turns * drifts;
        band_hz * time * turns * intervals * drifts * ln_beyond.exp()
    }

    /// The threshold that noise exceeds `rate_hz` times a second.
    pub(super) fn threshold(&self, rate_hz: f64, known: f64) -> f64 {
        let pulses = float(self.trials.pulses);
        let mut low = 1.5 * pulses;
        let mut high = pulses * self.ceiling;
        for _ in 0..50 {
            let middle = f64::midpoint(low, high);
            if self.rate_hz(middle, known) > rate_hz {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive")]
fn frames(count: f64) -> usize {
    count.round().max(0.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    /// A row with pulses of 1 at multiples of an interval: all are in one sum, at their start and
    /// interval, for every number of pulses; and no pulse is counted twice.
    #[test]
    fn pulses_are_added_up() {
        for (pulses, count) in (3..=12).zip(3_u8..) {
            let most = f32::from(count);
            for interval in [20.0, 20.37, 33.5] {
                let mut row = vec![0.0_f32; 700];
                for n in 0..pulses {
                    let middle = frames(40.0 + float(n) * interval);
                    // As long as four frames, as pulses are.
                    row[middle - 1..=middle + 1].fill(0.5);
                    row[middle] = 1.0;
                }
                let mut comb = Comb::new(pulses, [15.0, 40.0]);
                let mut best = (0.0, 0, 0);
                comb.fold(&row, 200, 0.6 * most, |place, start, sum| {
                    assert!(sum <= most, "{pulses}: {sum}");
                    if start.abs_diff(40) <= 1 && sum > best.0 {
                        best = (sum, place, start);
                    }
                });
                // Rounding may put a pulse a frame off, where half of it is left.
                let (sum, place, _) = best;
                assert!(sum >= 0.6 * most, "{pulses}, {interval}: {sum}");
                let off = (comb.intervals[place] - interval) * float(pulses - 1);
                assert!(off.abs() < 2.0, "{pulses}, {interval}: {}", comb.intervals[place]);
            }
        }
    }

    #[test]
    fn a_known_interval_is_one() {
        assert_eq!(Comb::new(5, [260.0, 260.0]).intervals, [260.0]);
        let comb = Comb::new(5, [254.8, 265.2]);
        assert_eq!(comb.intervals.len(), 43);
        assert_abs_diff_eq!(comb.intervals[42], 265.2, epsilon = 1e-9);
    }
}
