use foxhunt_core::EstimatorError;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::verdict::{NOTICEABLE, Verdict, probability};
use crate::count::number;

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

    /// Their degrees of freedom altogether.
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

/// Quantiles of χ²; `None` without a degree of freedom.
pub(super) fn quantiles<const K: usize>(degrees: usize, at: [f64; K]) -> Option<[f64; K]> {
    let chi_squared = ChiSquared::new(number(degrees)).ok()?;
    Some(at.map(|p| chi_squared.inverse_cdf(p)))
}

#[cfg(test)]
mod tests {
    use alloc::vec;

    use super::*;

    fn average(squares: &[(f64, usize)]) -> ChiSquaredAverage {
        let mut average = ChiSquaredAverage::default();
        average.extend(squares.iter().copied());
        average
    }

    #[test]
    fn the_intervals_of_the_book() {
        // Bar-Shalom, Li & Kirubarajan 2001, p. 236: [74.22, 129.56] for χ²₁₀₀, whether of 50 runs
        // in the plane or of 100 scalar innovations; χ²₂₀₀ likewise.
        for (count, degrees, sums) in
            [(50, 2, [74.22, 129.56]), (100, 1, [74.22, 129.56]), (100, 2, [162.73, 241.06])]
        {
            let interval = average(&vec![(1.0, degrees); count]).interval().expect("samples");
            for (at, sum) in interval.iter().zip(sums) {
                assert!(
                    (at * number(count) - sum).abs() < 0.01,
                    "{interval:?}, {count}, {degrees}"
                );
            }
        }
        // Far out, χ² is a normal: 2·10⁶ ± 1.96 · √(4·10⁶).
        let [low, high] = average(&vec![(1.0, 2000); 1000]).interval().expect("samples");
        assert!((low - 1996.08).abs() < 0.01 && (high - 2003.92).abs() < 0.01, "{low} {high}");
    }

    #[test]
    fn missing_components_count_less() {
        let mixed = average(&[(3.0, 2), (0.5, 1), (f64::NAN, 0), (2.5, 2)]);
        assert_eq!((mixed.count(), mixed.degrees_of_freedom()), (3, 5));
        assert!((mixed.average().expect("samples") - 2.0).abs() < 1e-15);
        assert!((mixed.expected().expect("samples") - 5.0 / 3.0).abs() < 1e-15);
        // χ²₅: 0.831 and 12.833 (Abramowitz & Stegun 1964, table 26.8).
        let [low, high] = mixed.interval().expect("samples");
        assert!((3.0 * low - 0.831_212).abs() < 1e-5 && (3.0 * high - 12.832_50).abs() < 1e-5);
        // By hand: variance 1.75, over three.
        let error = mixed.standard_error().expect("samples");
        assert!((error * error - 1.75 / 3.0).abs() < 1e-14, "{error}");
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
}
