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
}
