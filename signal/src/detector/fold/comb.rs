use std::mem;

use super::super::channeliser::float;

/// Adds up the energies of pulses at all starts and intervals (fast folding, Staelin 1969).
///
/// The sum of many pulses is that of its first half and its second, and sums of few pulses serve
/// many intervals: they need coarser steps of it. Intervals count in frames.
#[derive(Debug)]
pub(super) struct Comb {
    /// The intervals, ascending; the last pulse is a frame later from one to the next.
    pub(super) intervals: Vec<f64>,
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

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive")]
fn frames(count: f64) -> usize {
    count.round().max(0.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert!((comb.intervals[42] - 265.2).abs() < 1e-9);
    }
}
