use serde::Serialize;
use statrs::statistics::{Data, OrderStatistics, Statistics};

/// How errors are spread, in metres.
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
    /// The spread of some values; `None` where there are none.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        let [p10, p50, p90] = quantiles(values)?;
        Some(Self {
            p10,
            p50,
            p90,
            mean: values.mean(),
            rms: values.quadratic_mean(),
            max: values.max(),
        })
    }
}

/// How step counts are spread.
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
    /// The spread of some values; `None` where there are none.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        let [p10, p50, p90] = quantiles(values)?;
        Some(Self { mean: values.mean(), p10, p50, p90 })
    }
}

/// How a quantity is spread that some runs never reach: how many steps it takes, or how long.
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
    /// How many runs never got there.
    pub never: u32,
}

impl FirstPassage {
    /// The spread over runs, of which each has a value or never got there; `None` where there is
    /// no run.
    #[must_use]
    pub fn of(runs: impl IntoIterator<Item = Option<f64>>) -> Option<Self> {
        let values: Vec<f64> = runs.into_iter().map(|run| run.unwrap_or(f64::INFINITY)).collect();
        let never = values.iter().filter(|value| value.is_infinite()).count();
        // Between an infinite value and any other one lies no finite one.
        let [p10, p50, p90] =
            quantiles(&values)?.map(|value| Some(value).filter(|value| value.is_finite()));
        Some(Self { p10, p50, p90, never: u32::try_from(never).unwrap_or(u32::MAX) })
    }
}

fn quantiles(values: &[f64]) -> Option<[f64; 3]> {
    if values.is_empty() {
        return None;
    }
    let mut data = Data::new(values.to_vec());
    Some([0.1, 0.5, 0.9].map(|p| data.quantile(p)))
}

#[cfg(test)]
mod tests {
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
        assert!((spread.p90 - 90.0).abs() < 1.0 && (spread.p10 - 10.0).abs() < 1.0);
        assert_eq!(Spread::of(&[]), None);
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
