use std::f64::consts::TAU;

/// One peak of an interval transform.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IntervalPeak {
    /// The interval, in seconds.
    pub interval_s: f64,
    /// The transform's magnitude: about how many pairs of pulses are that far apart in phase.
    pub magnitude: f64,
    /// The magnitude over the threshold; above 1.
    pub excess: f64,
}

/// The interval transform: a complex autocorrelation of arrival times, whose phase cancels the
/// multiples of an interval.
///
/// ```text
/// D(τ_k) = Σ_n Σ_{m<n, |t_n − t_m − τ_k| ≤ ε τ_k} exp(2πi (t_n − O_k) / τ_k)
/// ```
///
/// with a time origin `O_k` for each bin that moves along with a train, and bins that overlap, so
/// that jitter does not smear the phase (Nishiguchi and Kobayashi 2000, improved algorithm). A bin
/// is a peak above the greatest of `α T/τ_k`, `β C_k` and `γ √(T ρ² b_k)`: its share of the
/// pulses to be expected, of the pairs in the bin, and of the noise of other pulses (equations 17
/// to 19), and above its neighbours.
#[derive(Debug, Clone, PartialEq)]
pub struct IntervalTransform {
    intervals_s: Vec<f64>,
    tolerance: f64,
}

/// The share of the pulses of a train that must be there.
const ALPHA: f64 = 0.15;
/// The share of a bin's pairs that must be in phase.
const BETA: f64 = 0.15;
/// The limit over other pulses' pairs, in their standard deviations.
const GAMMA: f64 = 3.0;
/// The most by which a pulse may be off the raster of its bin's origin, as a share, to become the
/// new one.
const ORIGIN: f64 = 0.03;

impl IntervalTransform {
    /// A transform over these shortest and longest intervals, in bins of ± `tolerance` of their
    /// middles that overlap by three quarters.
    #[must_use]
    pub fn new([shortest_s, longest_s]: [f64; 2], tolerance: f64) -> Self {
        let step = 1.0 + 0.5 * tolerance;
        let intervals = std::iter::successors(Some(shortest_s), |last| {
            Some(last * step).filter(|x| *x <= longest_s)
        });
        Self { intervals_s: intervals.collect(), tolerance }
    }

    /// Returns the number of bins.
    #[must_use]
    pub fn len(&self) -> usize {
        self.intervals_s.len()
    }

    /// Returns true if it has no bins.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.intervals_s.is_empty()
    }

    /// The peaks, the greatest excess first, of pulses at these times, which must rise.
    #[must_use]
    pub fn peaks(&self, times_s: &[f64]) -> Vec<IntervalPeak> {
        let (Some(first), Some(last), Some(shortest), Some(longest)) =
            (times_s.first(), times_s.last(), self.intervals_s.first(), self.intervals_s.last())
        else {
            return Vec::new();
        };
        let bins = self.transformed(times_s, *shortest, *longest);
        let span = (last - first).max(*shortest);
        let rate = count(times_s.len()) / span;
        let excess = |(bin, interval): (&Bin, &f64)| {
            let width = 2.0 * self.tolerance * interval;
            let threshold = (ALPHA * span / interval)
                .max(BETA * bin.pairs)
                .max(GAMMA * (span * rate * rate * width).sqrt());
            bin.magnitude() / threshold
        };
        let excesses: Vec<f64> = bins.iter().zip(&self.intervals_s).map(excess).collect();
        let is_peak = |index: usize| {
            // One interval fills the bins that overlap it.
            let near = index.saturating_sub(4)..(index + 5).min(bins.len());
            let magnitude = bins[index].magnitude();
            excesses[index] > 1.0
                && near.into_iter().all(|k| {
                    let other = bins[k].magnitude();
                    other < magnitude || (other <= magnitude && k >= index)
                })
        };
        let mut peaks: Vec<IntervalPeak> = (0..bins.len())
            .filter(|index| is_peak(*index))
            .map(|index| IntervalPeak {
                interval_s: bins[index].mean_s(),
                magnitude: bins[index].magnitude(),
                excess: excesses[index],
            })
            .collect();
        peaks.sort_by(|a, b| b.excess.total_cmp(&a.excess));
        peaks
    }

    fn transformed(&self, times_s: &[f64], shortest: f64, longest: f64) -> Vec<Bin> {
        let mut bins = vec![Bin::default(); self.intervals_s.len()];
        let low = 1.0 - self.tolerance;
        let high = 1.0 + self.tolerance;
        for (n, time) in times_s.iter().enumerate() {
            for before in times_s[..n].iter().rev() {
                let gap = time - before;
                if gap > longest * high {
                    break;
                }
                if gap < shortest * low {
                    continue;
                }
                let from = self.intervals_s.partition_point(|tau| tau * high < gap);
                let to = self.intervals_s.partition_point(|tau| tau * low <= gap);
                for (bin, interval_s) in bins[from..to].iter_mut().zip(&self.intervals_s[from..]) {
                    bin.add(*before, *time, *interval_s);
                }
            }
        }
        bins
    }
}

/// One bin of intervals.
#[derive(Debug, Clone, Copy, Default)]
struct Bin {
    origin_s: Option<f64>,
    re: f64,
    im: f64,
    pairs: f64,
    gaps_s: f64,
}

impl Bin {
    fn add(&mut self, before: f64, time: f64, tau: f64) {
        let origin = self.origin_s.unwrap_or(before);
        let turns = (time - origin) / tau;
        let whole = (turns + 0.4999).floor();
        let off = turns / whole - 1.0;
        let follows = before <= origin && origin <= before;
        let origin = if (whole <= 1.0 && follows) || (whole >= 2.0 && off.abs() <= ORIGIN) {
            time
        } else {
            origin
        };
        self.origin_s = Some(origin);
        let (sin, cos) = (TAU * (time - origin) / tau).sin_cos();
        self.re += cos;
        self.im += sin;
        self.pairs += 1.0;
        self.gaps_s += time - before;
    }

    fn magnitude(&self) -> f64 {
        self.re.hypot(self.im)
    }

    fn mean_s(&self) -> f64 {
        self.gaps_s / self.pairs.max(1.0)
    }
}

#[expect(clippy::cast_precision_loss, reason = "numbers of pulses are below 2^53")]
pub(super) fn count(number: usize) -> f64 {
    number as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::abs_diff_eq;

    /// Two trains in one list: their intervals are peaks, and twice an interval, which as many
    /// pairs have, is not.
    #[test]
    fn intervals_are_peaks_and_their_multiples_are_not() {
        let train = |interval: f64, phase: f64| {
            // Jitter of a few milliseconds, the same in every run.
            (0..80_u32).map(move |n| {
                phase + interval * f64::from(n) + 0.003 * f64::from(n * 7 % 11 % 5) - 0.006
            })
        };
        let mut times: Vec<f64> = train(1.0, 0.2).chain(train(1.37, 0.5)).collect();
        times.sort_by(f64::total_cmp);
        let peaks = IntervalTransform::new([0.3, 4.0], 0.01).peaks(&times);
        let has = |interval: f64| {
            peaks.iter().any(|peak| (peak.interval_s / interval - 1.0).abs() < 0.008)
        };
        assert!(has(1.0) && has(1.37), "{peaks:?}");
        assert!(!has(2.0) && !has(2.74) && !has(3.0), "{peaks:?}");
        let strongest = peaks[0].interval_s.min(peaks[1].interval_s);
        assert!(abs_diff_eq!(strongest, 1.0, epsilon = 0.01), "{peaks:?}");
    }
}
