use foxhunt_core::EstimatorError;
use statrs::distribution::{Beta, ContinuousCDF};

use super::verdict::{NOTICEABLE, Verdict, probability};
use crate::count::number;

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

#[cfg(test)]
mod tests {
    use super::*;

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
        assert!((nees.share().expect("three") - 1.0 / 3.0).abs() < 1e-15);
        assert!(Coverage::new(1.0, 0.95).is_err() && Coverage::new(0.95, 0.0).is_err());
    }
}
