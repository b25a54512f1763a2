//! Verdicts on covariances, from averages of χ² numbers and from coverage.

use core::fmt;

use foxhunt_core::{EstimatorError, parameter::require};
use statrs::distribution::{Beta, ChiSquared, ContinuousCDF};

use crate::count::number;

/// A covariance that is wrong by this factor is one that a test must be able to notice.
const NOTICEABLE: f64 = 1.5;

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
    fn of(value: f64, interval: [f64; 2], wrong: [f64; 2]) -> Self {
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

/// The average of normalised squares against χ²: of estimation errors (NEES, averaged ANEES) or
/// of innovations (NIS, averaged ANIS).
///
/// The sum of independent squares of a consistent filter is χ² with the sum of their degrees of
/// freedom, which need not be alike: a missing component takes one away (Bar-Shalom, Li &
/// Kirubarajan 2001, §5.4.2). NEES have to come from different runs, one of each; NIS of one run
/// are independent of each other.
///
/// A posterior that is not Gaussian has E\[NEES\] = N all the same, but is not χ²:
/// [`standard_error`](Self::standard_error) is the sample's own.
///
/// ```
/// # use foxhunt_filters::consistency::{ChiSquaredAverage, Verdict};
/// # fn main() -> Result<(), foxhunt_core::EstimatorError> {
/// let mut anees = ChiSquaredAverage::new(0.95)?;
/// for run in 0..50_u8 {
///     anees.add(1.0 + f64::from(run) / 25.0, 2);
/// }
/// assert!((anees.average().unwrap_or(0.0) - 1.98).abs() < 1e-12);
/// // Bar-Shalom, Li & Kirubarajan 2001, p. 236: 50 runs, two degrees of freedom.
/// let [low, high] = anees.interval().unwrap_or_default();
/// assert!((low - 1.484).abs() < 1e-3 && (high - 2.591).abs() < 1e-3);
/// assert_eq!(anees.verdict(), Verdict::Consistent);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChiSquaredAverage {
    probability: f64,
    sum: f64,
    sum_of_squares: f64,
    degrees_of_freedom: usize,
    count: usize,
}

impl ChiSquaredAverage {
    /// No square yet; a consistent filter's average lies in the interval with `probability`.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when the probability is not in (0, 1).
    pub fn new(probability: f64) -> Result<Self, EstimatorError> {
        let probability = self::probability("probability", probability)?;
        Ok(Self { probability, ..Self::default() })
    }

    /// Adds one normalised square with its degrees of freedom: the components of the state, or
    /// those present in the observation. Without any there is nothing to add.
    pub fn add(&mut self, square: f64, degrees_of_freedom: usize) {
        if degrees_of_freedom > 0 {
            self.sum += square;
            self.sum_of_squares += square * square;
            self.degrees_of_freedom += degrees_of_freedom;
            self.count += 1;
        }
    }

    /// Adds squares that were summed up elsewhere, such as in one run. Sums of sums round otherwise
    /// than one sum, in the last digits.
    pub fn add_sums(&mut self, sums: &ChiSquaredSums) {
        self.sum += sums.sum;
        self.sum_of_squares += sums.sum_of_squares;
        self.degrees_of_freedom += sums.degrees_of_freedom;
        self.count += sums.count;
    }

    /// The sums so far.
    #[must_use]
    pub fn sums(&self) -> ChiSquaredSums {
        let Self { sum, sum_of_squares, degrees_of_freedom, count, .. } = *self;
        ChiSquaredSums { sum, sum_of_squares, degrees_of_freedom, count }
    }

    /// Returns the number of squares added.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Returns the degrees of freedom of all squares together.
    #[must_use]
    pub fn degrees_of_freedom(&self) -> usize {
        self.degrees_of_freedom
    }

    /// The average: ANEES or ANIS; `None` without any square.
    #[must_use]
    pub fn average(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / number(self.count))
    }

    /// Expected average of a consistent filter: the mean of the degrees of freedom.
    #[must_use]
    pub fn expected(&self) -> Option<f64> {
        (self.count > 0).then(|| number(self.degrees_of_freedom) / number(self.count))
    }

    /// Interval that holds a consistent filter's average with the stated probability, with as much
    /// of the rest below as above.
    #[must_use]
    pub fn interval(&self) -> Option<[f64; 2]> {
        let tail = 0.5 * (1.0 - self.probability);
        let sums = quantiles(self.degrees_of_freedom, [tail, 1.0 - tail])?;
        Some(sums.map(|sum| sum / number(self.count)))
    }

    /// The standard error of the average by the squares' own scatter, whatever their distribution;
    /// `None` for less than two.
    #[must_use]
    pub fn standard_error(&self) -> Option<f64> {
        let count = number(self.count);
        let mean = self.average()?;
        let variance = (self.sum_of_squares - count * mean * mean) / (count - 1.0);
        (self.count > 1).then(|| libm::sqrt(variance.max(0.0) / count))
    }

    /// Judges if the squares are as large as they should be, by the rule of [`Verdict`].
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        match (self.average(), self.expected(), self.interval()) {
            (Some(average), Some(expected), Some(interval)) => {
                Verdict::of(average, interval, [expected / NOTICEABLE, expected * NOTICEABLE])
            }
            _ => Verdict::TooFew,
        }
    }
}

impl Default for ChiSquaredAverage {
    /// No square yet, at 95 %.
    fn default() -> Self {
        Self { probability: 0.95, sum: 0.0, sum_of_squares: 0.0, degrees_of_freedom: 0, count: 0 }
    }
}

impl Extend<(f64, usize)> for ChiSquaredAverage {
    fn extend<I: IntoIterator<Item = (f64, usize)>>(&mut self, squares: I) {
        squares.into_iter().for_each(|(square, degrees)| self.add(square, degrees));
    }
}

/// Sums of a [`ChiSquaredAverage`], to be kept and added to another one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChiSquaredSums {
    /// Sum of the squares.
    pub sum: f64,
    /// Sum of the squares' squares.
    pub sum_of_squares: f64,
    /// Sum of the degrees of freedom.
    pub degrees_of_freedom: usize,
    /// Number of squares.
    pub count: usize,
}

/// Share of confidence ellipses that hold the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coverage {
    nominal: f64,
    probability: f64,
    inside: usize,
    count: usize,
}

impl Coverage {
    /// No ellipse yet. Each is meant to hold the truth with the probability `nominal`;
    /// `probability` is that of the [`interval`](Self::interval).
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when one of them is not in (0, 1).
    pub fn new(nominal: f64, probability: f64) -> Result<Self, EstimatorError> {
        let nominal = self::probability("nominal coverage", nominal)?;
        let probability = self::probability("probability", probability)?;
        Ok(Self { nominal, probability, inside: 0, count: 0 })
    }

    /// Adds one ellipse, which holds the truth or not.
    pub fn add(&mut self, inside: bool) {
        self.inside += usize::from(inside);
        self.count += 1;
    }

    /// Adds the ellipse of an estimate in the plane by its NEES: χ²₂ has the quantile
    /// −2 ln(1 − p).
    pub fn add_nees(&mut self, nees: f64) {
        self.add(nees <= -2.0 * libm::log1p(-self.nominal));
    }

    /// Returns the number of ellipses added.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// The share of them that hold the truth; `None` without any.
    #[must_use]
    pub fn share(&self) -> Option<f64> {
        (self.count > 0).then(|| number(self.inside) / number(self.count))
    }

    /// Confidence interval of the true share (Clopper & Pearson 1934), which holds it with at least
    /// the stated probability for any count. `None` without any ellipse.
    #[must_use]
    pub fn interval(&self) -> Option<[f64; 2]> {
        let tail = 0.5 * (1.0 - self.probability);
        let inside = number(self.inside);
        let outside = number(self.count - self.inside);
        let bound = |a: f64, b: f64, at: f64| Some(Beta::new(a, b).ok()?.inverse_cdf(at));
        let low = match self.inside {
            _ if self.count == 0 => return None,
            0 => 0.0,
            _ => bound(inside, outside + 1.0, tail)?,
        };
        let high =
            if self.inside == self.count { 1.0 } else { bound(inside + 1.0, outside, 1.0 - tail)? };
        Some([low, high])
    }

    /// Judges if the ellipses hold the truth as often as they should. The rule is that of
    /// [`Verdict`]; a Gaussian in the plane whose covariance is s times too small is held by its
    /// ellipse with 1 − (1 − p)^(1/s).
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        let Some([low, high]) = self.interval() else { return Verdict::TooFew };
        let held = |factor: f64| -libm::expm1(libm::log1p(-self.nominal) / factor);
        if self.nominal > high {
            Verdict::OverConfident
        } else if self.nominal < low {
            Verdict::UnderConfident
        } else if low > held(NOTICEABLE) && high < held(1.0 / NOTICEABLE) {
            Verdict::Consistent
        } else {
            Verdict::TooFew
        }
    }
}

/// `value`, when it is a probability that leaves room on both sides.
pub(super) fn probability(name: &'static str, value: f64) -> Result<f64, EstimatorError> {
    Ok(require(value > 0.0 && value < 1.0, name, value, "in (0, 1)")?)
}

/// Quantiles of χ²; `None` without a degree of freedom.
pub(super) fn quantiles<const K: usize>(degrees: usize, at: [f64; K]) -> Option<[f64; K]> {
    let chi_squared = ChiSquared::new(number(degrees)).ok()?;
    Some(at.map(|p| chi_squared.inverse_cdf(p)))
}

#[cfg(test)]
mod tests {
    use alloc::vec;
    use approx::{abs_diff_eq, assert_abs_diff_eq};

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

    fn average(squares: &[(f64, usize)]) -> ChiSquaredAverage {
        let mut average = ChiSquaredAverage::default();
        average.extend(squares.iter().copied());
        average
    }

    #[test]
    fn the_intervals_of_the_book() {
        // Bar-Shalom, Li & Kirubarajan 2001, p. 236: [74.22, 129.56] for χ²₁₀₀, whether of
        // 50 runs in the plane or of 100 scalar innovations; χ²₂₀₀ likewise.
        for (count, degrees, sums) in
            [(50, 2, [74.22, 129.56]), (100, 1, [74.22, 129.56]), (100, 2, [162.73, 241.06])]
        {
            let interval = average(&vec![(1.0, degrees); count]).interval().expect("samples");
            for (at, sum) in interval.iter().zip(sums) {
                assert!(
                    abs_diff_eq!(at * number(count), sum, epsilon = 0.01),
                    "{interval:?}, {count}, {degrees}"
                );
            }
        }
        // Far out, χ² is a normal: 2·10⁶ ± 1.96 · √(4·10⁶).
        let [low, high] = average(&vec![(1.0, 2000); 1000]).interval().expect("samples");
        assert_abs_diff_eq!(low, 1996.08, epsilon = 0.01);
        assert_abs_diff_eq!(high, 2003.92, epsilon = 0.01);
    }

    #[test]
    fn missing_components_count_less() {
        let mixed = average(&[(3.0, 2), (0.5, 1), (f64::NAN, 0), (2.5, 2)]);
        assert_eq!((mixed.count(), mixed.degrees_of_freedom()), (3, 5));
        assert_abs_diff_eq!(mixed.average().expect("samples"), 2.0, epsilon = 1e-15);
        assert_abs_diff_eq!(mixed.expected().expect("samples"), 5.0 / 3.0, epsilon = 1e-15);
        // χ²₅: 0.831 and 12.833 (Abramowitz & Stegun 1964, table 26.8).
        let [low, high] = mixed.interval().expect("samples");
        assert_abs_diff_eq!(3.0 * low, 0.831_212, epsilon = 1e-5);
        assert_abs_diff_eq!(3.0 * high, 12.832_50, epsilon = 1e-5);
        // By hand: variance 1.75, over three.
        let error = mixed.standard_error().expect("samples");
        assert_abs_diff_eq!(error * error, 1.75 / 3.0, epsilon = 1e-14);
    }

    #[test]
    fn sums_of_parts_are_those_of_the_whole() {
        let squares = [(3.0, 2), (0.5, 1), (2.5, 2)];
        let (first, second) = squares.split_at(1);
        let mut parts = average(first);
        parts.add_sums(&average(second).sums());
        assert_eq!(parts, average(&squares));
        assert_eq!(average(&[]).sums(), ChiSquaredSums::default());
    }

    #[test]
    fn verdicts_need_enough_runs() {
        let of = |square, runs| average(&vec![(square, 2); runs]).verdict();
        assert_eq!(of(2.0, 0), Verdict::TooFew);
        assert_eq!(of(2.0, 28), Verdict::TooFew);
        assert_eq!(of(2.0, 29), Verdict::Consistent);
        assert_eq!(of(3.0, 29), Verdict::OverConfident);
        assert_eq!(of(2.0 / 1.5, 29), Verdict::UnderConfident);
        assert_eq!(of(20.0, 3), Verdict::OverConfident, "three runs can be enough");
        assert_eq!(of(f64::NAN, 100), Verdict::OverConfident);
        assert!(ChiSquaredAverage::new(1.0).is_err() && ChiSquaredAverage::new(f64::NAN).is_err());
    }

    fn coverage(inside: usize, count: usize) -> Coverage {
        let mut coverage = Coverage::new(0.95, 0.95).expect("in range");
        (0..count).for_each(|i| coverage.add(i < inside));
        coverage
    }

    #[test]
    fn clopper_and_pearson() {
        // Known values: 5 of 10, [0.18709, 0.81291]; 0 of 10, 1 − 0.025^(1/10); 95 of 100.
        for (inside, count, exact) in [
            (5, 10, [0.187_086, 0.812_914]),
            (0, 10, [0.0, 0.308_497]),
            (10, 10, [0.691_503, 1.0]),
            (95, 100, [0.887_165, 0.983_568]),
        ] {
            let interval = coverage(inside, count).interval().expect("some");
            for (found, exact) in interval.iter().zip(exact) {
                assert!((found - exact).abs() < 2e-6, "{inside} of {count}: {interval:?}");
            }
        }
        assert_eq!(coverage(0, 0).interval(), None);
    }

    #[test]
    fn ellipses_that_hold_less_are_over_confident() {
        assert_eq!(coverage(860, 1000).verdict(), Verdict::OverConfident);
        assert_eq!(coverage(990, 1000).verdict(), Verdict::UnderConfident);
        assert_eq!(coverage(950, 1000).verdict(), Verdict::Consistent);
        assert_eq!(coverage(19, 20).verdict(), Verdict::TooFew);
        assert_eq!(coverage(0, 0).verdict(), Verdict::TooFew);
        let mut nees = Coverage::new(0.95, 0.95).expect("in range");
        [5.99, 6.0, f64::NAN].iter().for_each(|n| nees.add_nees(*n));
        assert_abs_diff_eq!(nees.share().expect("three"), 1.0 / 3.0, epsilon = 1e-15);
        assert!(Coverage::new(1.0, 0.95).is_err() && Coverage::new(0.95, 0.0).is_err());
    }
}
