use ddsketchy::DDSketch;
use serde::Serialize;
use statrs::statistics::{Data, OrderStatistics};

/// Up to this number of values quantiles are exact; beyond, a sketch gives them.
const EXACT: usize = 1 << 16;

/// The relative error of a sketch's quantiles.
const SKETCH_ERROR: f64 = 1e-3;

/// A sketch's largest number of buckets: nine decades at that error.
const SKETCH_BUCKETS: usize = 10_400;

/// Running figures of any number of values in bounded memory, in the order in which they come: the
/// mean and the mean square by Welford's recurrence (1962), and quantiles.
///
/// Up to 65 536 values the quantiles are exact. Beyond, they come from a sketch with logarithmic
/// buckets (Masson, Rim & Lee 2019, DDSketch) and err by at most a thousandth of the quantile, for
/// values that span up to nine decades. Values are positive, zero or infinite.
#[derive(Clone, Debug, Default)]
pub(crate) struct Running {
    count: f64,
    mean: f64,
    mean_square: f64,
    max: f64,
    infinite: u32,
    exact: Vec<f64>,
    /// The sketch of the finite values, once there are too many.
    sketch: Option<DDSketch>,
}

impl Running {
    pub(crate) fn add(&mut self, value: f64) {
        self.count += 1.0;
        self.mean += (value - self.mean) / self.count;
        self.mean_square += (value * value - self.mean_square) / self.count;
        self.max = if self.count > 1.0 { self.max.max(value) } else { value };
        self.infinite = self.infinite.saturating_add(u32::from(value.is_infinite()));
        match &mut self.sketch {
            Some(sketch) if value.is_finite() => sketch.add(value),
            Some(_) => {}
            None => self.exact.push(value),
        }
        if self.exact.len() > EXACT {
            let mut sketch = DDSketch::with_max_bins(SKETCH_ERROR, SKETCH_BUCKETS)
                .expect("the error is between 0 and 1");
            let values = std::mem::take(&mut self.exact);
            values.iter().filter(|value| value.is_finite()).for_each(|value| sketch.add(*value));
            self.sketch = Some(sketch);
        }
    }

    /// A tenth, the median and nine tenths; `None` where there are no values.
    fn quantiles(&self) -> Option<[f64; 3]> {
        const AT: [f64; 3] = [0.1, 0.5, 0.9];
        if self.count < 1.0 {
            return None;
        }
        let Some(sketch) = &self.sketch else {
            let mut data = Data::new(self.exact.clone());
            return Some(AT.map(|p| data.quantile(p)));
        };
        // The infinite ones are above all others.
        let finite = self.count - f64::from(self.infinite);
        Some(AT.map(|p| {
            let below = p * self.count / finite;
            let within = (below <= 1.0).then(|| sketch.quantile(below).ok()).flatten();
            within.unwrap_or(f64::INFINITY)
        }))
    }

    /// The spread of errors; `None` where there are no values.
    pub(crate) fn spread(&self) -> Option<Spread> {
        let [p10, p50, p90] = self.quantiles()?;
        let mean = self.mean;
        let rms = self.mean_square.sqrt();
        Some(Spread { p10, p50, p90, mean, rms, max: self.max })
    }

    /// The spread of step counts; `None` where there are no values.
    pub(crate) fn step_spread(&self) -> Option<StepSpread> {
        let [p10, p50, p90] = self.quantiles()?;
        Some(StepSpread { mean: self.mean, p10, p50, p90 })
    }

    /// The spread of what some runs never reach, which are infinite; `None` where there is no run.
    pub(crate) fn first_passage(&self) -> Option<FirstPassage> {
        // Between an infinite value and any other one lies no finite one.
        let [p10, p50, p90] =
            self.quantiles()?.map(|value| Some(value).filter(|value| value.is_finite()));
        Some(FirstPassage { p10, p50, p90, never: self.infinite })
    }
}

impl FromIterator<f64> for Running {
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Self {
        let mut running = Self::default();
        values.into_iter().for_each(|value| running.add(value));
        running
    }
}

/// The spread of errors, in metres. With more than 65 536 values the quantiles err by up to a
/// thousandth; all else is exact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// A tenth of the values is below.
    pub p10: f64,
    /// The median.
    pub p50: f64,
    /// A tenth of the values is above.
    pub p90: f64,
    /// The mean.
    pub mean: f64,
    /// The root of the mean square.
    pub rms: f64,
    /// The largest.
    pub max: f64,
}

impl Spread {
    /// The spread of some values; `None` without a value.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        values.iter().copied().collect::<Running>().spread()
    }
}

/// The spread of step counts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StepSpread {
    /// The mean.
    pub mean: f64,
    /// A tenth of the values is below.
    pub p10: f64,
    /// The median.
    pub p50: f64,
    /// A tenth of the values is above.
    pub p90: f64,
}

impl StepSpread {
    /// The spread of some values; `None` without a value.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        values.iter().copied().collect::<Running>().step_spread()
    }
}

/// The spread of a quantity that some runs never reach: the number of steps that it takes, or the
/// time.
///
/// A run that never got there counts as infinite in the quantiles; one that is not finite is
/// absent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FirstPassage {
    /// A tenth of the runs is below.
    pub p10: Option<f64>,
    /// The median.
    pub p50: Option<f64>,
    /// A tenth of the runs is above.
    pub p90: Option<f64>,
    /// The number of runs that never got there.
    pub never: u32,
}

impl FirstPassage {
    /// The spread over runs, of which each has a value or never got there; `None` where there is
    /// no run.
    #[must_use]
    pub fn of(runs: impl IntoIterator<Item = Option<f64>>) -> Option<Self> {
        let values = runs.into_iter().map(|run| run.unwrap_or(f64::INFINITY));
        values.collect::<Running>().first_passage()
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use approx::assert_relative_eq;

    use super::*;

    #[test]
    fn a_known_spread() {
        let values: Vec<f64> = (0..=100).map(f64::from).collect();
        let spread = Spread::of(&values).expect("there are values");
        assert_relative_eq!(spread.p50, 50.0, epsilon = 1e-12);
        assert_relative_eq!(spread.mean, 50.0, epsilon = 1e-12);
        assert_relative_eq!(spread.max, 100.0, epsilon = 1e-12);
        // Σ i² = n (n + 1) (2n + 1) / 6 with n = 100.
        assert_relative_eq!(spread.rms, (338_350.0_f64 / 101.0).sqrt(), epsilon = 1e-12);
        assert_abs_diff_eq!(spread.p90, 90.0, epsilon = 1.0);
        assert_abs_diff_eq!(spread.p10, 10.0, epsilon = 1.0);
        assert_eq!(Spread::of(&[]), None);
    }

    /// Half as many values again as are kept: exponential ones, by the inverse of their
    /// distribution at equal steps, so that their quantiles are known.
    #[test]
    fn quantiles_of_many_values_err_by_a_thousandth() {
        let count = u32::try_from(EXACT + EXACT / 2).expect("a small number");
        let share = |i: u32| (f64::from(i) + 0.5) / f64::from(count);
        // In an order that is neither that of the values nor its reverse.
        let shuffled = (0..count).map(|i| i.wrapping_mul(7919) % count);
        let values = shuffled.map(|i| -(-share(i)).ln_1p());
        let running: Running = values.collect();
        assert!(running.sketch.is_some() && running.exact.is_empty());
        let spread = running.spread().expect("there are values");
        for (p, found) in [(0.1_f64, spread.p10), (0.5, spread.p50), (0.9, spread.p90)] {
            let exact = -(-p).ln_1p();
            assert!((found / exact - 1.0).abs() < 1.1 * SKETCH_ERROR, "{p}: {found}, {exact}");
        }
        assert_relative_eq!(spread.mean, 1.0, epsilon = 1e-4);
        // A quarter more that never get there: the ninth tenth is among these, the median at 5/8.
        let mut running = running;
        (0..count / 4).for_each(|_| running.add(f64::INFINITY));
        let passage = running.first_passage().expect("there are runs");
        assert_eq!((passage.never, passage.p90), (count / 4, None));
        let exact = -(-0.625_f64).ln_1p();
        assert_abs_diff_eq!(
            passage.p50.expect("the median") / exact,
            1.0,
            epsilon = 1.1 * SKETCH_ERROR
        );
    }

    #[test]
    fn who_never_gets_there_counts_as_infinite() {
        let runs = |reached: i32| (0..100).map(move |i| (i < reached).then(|| f64::from(i)));
        let all = FirstPassage::of(runs(100)).expect("there are runs");
        assert_eq!(all.never, 0);
        assert_relative_eq!(all.p50.expect("all of them"), 49.5, epsilon = 1e-12);
        let most = FirstPassage::of(runs(80)).expect("there are runs");
        assert_eq!((most.never, most.p90), (20, None));
        // The others are where they were: what is far above does not move them.
        assert_eq!((most.p10, most.p50), (all.p10, all.p50));
        let few = FirstPassage::of(runs(20)).expect("there are runs");
        assert_eq!((few.never, few.p10, few.p50, few.p90), (80, all.p10, None, None));
        let none = FirstPassage::of(runs(0)).expect("there are runs");
        assert_eq!((none.never, none.p10, none.p50), (100, None, None));
        assert_eq!(FirstPassage::of([]), None);
    }
}
