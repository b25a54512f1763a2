use core::fmt;

use foxhunt_core::{EstimatorError, parameter::require};

/// A covariance that is wrong by this factor is one that a test must be able to notice.
pub(super) const NOTICEABLE: f64 = 1.5;

/// Verdict on the size of an estimator's errors against its covariance.
///
/// The rule: what lies outside the interval of a consistent estimator is reported as such, however
/// few the runs. Inside it, the estimator is called consistent only if there were enough runs to
/// decide: an estimator whose covariance is wrong by a factor of 1.5, up or down, has to be
/// expected outside the interval. Otherwise there were too few. With two degrees of freedom and
/// 95 % that takes 29 runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum Verdict {
    /// Errors are as large as the covariance.
    Consistent,
    /// Errors are larger than the covariance.
    OverConfident,
    /// Errors are smaller than the covariance.
    UnderConfident,
    /// No difference was found, but a factor of 1.5 would not have been noticed either.
    TooFew,
}

impl Verdict {
    /// The verdict on `value`, which grows with over-confidence: `interval` holds it for a
    /// consistent estimator, `wrong` are its values for covariances 1.5 times too large and too
    /// small. A value that is no number is an over-confident one.
    pub(super) fn of(value: f64, interval: [f64; 2], wrong: [f64; 2]) -> Self {
        let [low, high] = interval;
        if value < low {
            Self::UnderConfident
        } else if value <= high {
            let distinguished = wrong[0] < low && wrong[1] > high;
            if distinguished { Self::Consistent } else { Self::TooFew }
        } else {
            Self::OverConfident
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Consistent => "consistent",
            Self::OverConfident => "over-confident",
            Self::UnderConfident => "under-confident",
            Self::TooFew => "too few",
        })
    }
}

/// `value`, when it is a probability that leaves room on both sides.
pub(super) fn probability(name: &'static str, value: f64) -> Result<f64, EstimatorError> {
    Ok(require(value > 0.0 && value < 1.0, name, value, "in (0, 1)")?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_inside_a_wide_interval_gives_no_information() {
        let wrong = [2.0 / 1.5, 3.0];
        assert_eq!(Verdict::of(2.0, [1.8, 2.2], wrong), Verdict::Consistent);
        assert_eq!(Verdict::of(2.0, [1.3, 2.8], wrong), Verdict::TooFew);
        assert_eq!(Verdict::of(2.0, [1.4, 3.1], wrong), Verdict::TooFew);
        assert_eq!(Verdict::of(4.0, [1.0, 3.1], wrong), Verdict::OverConfident);
        assert_eq!(Verdict::of(0.9, [1.0, 3.1], wrong), Verdict::UnderConfident);
        assert_eq!(Verdict::of(f64::NAN, [1.8, 2.2], wrong), Verdict::OverConfident);
    }
}
