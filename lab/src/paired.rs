use serde::Serialize;
use statrs::{
    distribution::{ContinuousCDF, StudentsT},
    statistics::Statistics,
};

/// How the errors of two ways to do the same thing compare, run by run.
///
/// The ratio of two errors of one run, and not their difference: errors are skewed, and their
/// logarithms nearly Gaussian.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Paired {
    /// How many runs have both.
    pub pairs: usize,
    /// The geometric mean of the first one's error over the second's.
    pub ratio: f64,
    /// Where the true ratio lies with 95 %, by Student's t on the logarithms.
    pub ratio_interval: [f64; 2],
    /// The probability of a ratio as far from 1 were there no difference, by the same test on both
    /// sides.
    pub p_value: f64,
}

impl Paired {
    /// The comparison of pairs of positive errors; `None` for less than two, or where their
    /// ratios are all the same.
    #[must_use]
    pub fn of(pairs: impl IntoIterator<Item = (f64, f64)>) -> Option<Self> {
        let logs: Vec<f64> = pairs
            .into_iter()
            .map(|(first, second)| (first / second).ln())
            .filter(|log| log.is_finite())
            .collect();
        let pairs = logs.len();
        #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 runs")]
        let count = pairs as f64;
        let (mean, error) = ((&logs).mean(), (&logs).std_dev() / count.sqrt());
        if !(error > 0.0 && error.is_finite()) {
            return None;
        }
        let student = StudentsT::new(0.0, 1.0, count - 1.0).ok()?;
        let reach = student.inverse_cdf(0.975) * error;
        Some(Self {
            pairs,
            ratio: mean.exp(),
            ratio_interval: [(mean - reach).exp(), (mean + reach).exp()],
            p_value: 2.0 * student.cdf(-(mean / error).abs()),
        })
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    #[test]
    fn the_textbook_numbers() {
        // Logarithms of the ratios: 0.1, 0.3, 0.2, 0.4; mean 0.25, s.d. 0.1291, t = 3.873 with
        // 3 degrees of freedom, for which p = 0.0305 and the quantile of 97.5 % is 3.1824.
        let pairs = [0.1_f64, 0.3, 0.2, 0.4].map(|log| (5.0 * log.exp(), 5.0));
        let reported = Paired::of(pairs).expect("four pairs");
        assert_eq!(reported.pairs, 4);
        assert_relative_eq!(reported.ratio, 0.25_f64.exp(), epsilon = 1e-12);
        assert_relative_eq!(reported.p_value, 0.0305, epsilon = 1e-4);
        let reach = 3.1824 * 0.129_099 / 2.0;
        assert_relative_eq!(reported.ratio_interval[0].ln(), 0.25 - reach, epsilon = 1e-4);
        assert_relative_eq!(reported.ratio_interval[1].ln(), 0.25 + reach, epsilon = 1e-4);
        let turned = Paired::of(pairs.map(|(a, b)| (b, a))).expect("four pairs");
        assert_relative_eq!(turned.ratio * reported.ratio, 1.0, epsilon = 1e-12);
        assert_relative_eq!(turned.p_value, reported.p_value, epsilon = 1e-12);
    }

    #[test]
    fn nothing_to_compare_is_no_comparison() {
        assert_eq!(Paired::of([]), None);
        assert_eq!(Paired::of([(1.0, 2.0)]), None);
        assert_eq!(Paired::of([(1.0, 2.0), (2.0, 4.0)]), None);
        assert_eq!(Paired::of([(0.0, 2.0), (2.0, f64::NAN), (1.0, 3.0)]), None);
    }
}
