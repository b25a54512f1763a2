use alloc::{vec, vec::Vec};

use nalgebra::SVector;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::{Innovation, count::number};

/// Test of innovations for whiteness: a consistent filter leaves nothing in one that could have
/// been predicted from those before it (Bar-Shalom, Li & Kirubarajan 2001, §5.4.2, the time-average
/// autocorrelation).
///
/// ρ(l) = Σₖ ν(k)ᵀ ν(k + l) / Σₖ ν(k)ᵀ ν(k) over normalised innovations ν, whose components are
/// independent and of zero mean if the filter is consistent. For T such numbers with P pairs l
/// apart, ρ(l) then has the mean 0 and the variance P / (T (T + 2)), exactly: their direction is
/// uniform in T dimensions. Missing components make fewer pairs.
///
/// A bias is a correlation too: no mean is subtracted.
#[derive(Clone, Debug, PartialEq)]
pub struct Whiteness {
    products: Vec<f64>,
    pairs: Vec<usize>,
    squares: f64,
    values: usize,
}

/// The autocorrelation at one lag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Autocorrelation {
    /// Distance of the two innovations, 1 for neighbours.
    pub lag: usize,
    /// ρ(l).
    pub rho: f64,
    /// The standard deviation of ρ(l) if the innovations are white: in 95 of 100 cases |ρ| is
    /// below 1.96 of these.
    pub sigma: f64,
}

/// The portmanteau test of all lags at once (Ljung & Box 1978).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LjungBox {
    /// Q = Σ ρ(l)² / σ(l)².
    pub statistic: f64,
    /// Number of lags: Q is nearly χ² with as many degrees of freedom.
    pub lags: usize,
    /// The probability of a larger Q if the innovations are white.
    pub p_value: f64,
}

impl Whiteness {
    /// No innovation yet; the lags 1 to `lags` are looked at.
    #[must_use]
    pub fn new(lags: usize) -> Self {
        Self { products: vec![0.0; lags], pairs: vec![0; lags], squares: 0.0, values: 0 }
    }

    /// Adds the innovations of one run, in their order. A missing component is `None`: it makes
    /// no pair, and keeps its place in time.
    pub fn add_run<const M: usize>(&mut self, run: &[SVector<Option<f64>, M>]) {
        for (k, now) in run.iter().enumerate() {
            for value in now.iter().flatten() {
                self.squares += value * value;
                self.values += 1;
            }
            let earlier = run[..k].iter().rev();
            let sums = self.products.iter_mut().zip(&mut self.pairs);
            for (before, (product, pairs)) in earlier.zip(sums) {
                for (a, b) in now.iter().zip(before).filter_map(|(a, b)| a.zip(*b)) {
                    *product += a * b;
                    *pairs += 1;
                }
            }
        }
    }

    /// The autocorrelations at all lags that have a pair.
    pub fn autocorrelations(&self) -> impl Iterator<Item = Autocorrelation> + '_ {
        let values = number(self.values);
        let at = move |(i, (product, pairs)): (usize, (&f64, &usize))| {
            let sigma = libm::sqrt(number(*pairs) / (values * (values + 2.0)));
            Autocorrelation { lag: i + 1, rho: product / self.squares, sigma }
        };
        let sums = self.products.iter().zip(&self.pairs).enumerate();
        sums.filter(|(_, (_, pairs))| **pairs > 0).map(at)
    }

    /// All lags at once; `None` where no lag has a pair.
    #[must_use]
    pub fn ljung_box(&self) -> Option<LjungBox> {
        let mut statistic = 0.0;
        let mut lags = 0;
        for Autocorrelation { rho, sigma, .. } in self.autocorrelations() {
            statistic += rho * rho / (sigma * sigma);
            lags += 1;
        }
        let white = ChiSquared::new(number(lags)).ok()?;
        // A NaN statistic means that some innovation was NaN: reject.
        let p_value = if statistic >= 0.0 { white.sf(statistic) } else { 0.0 };
        Some(LjungBox { statistic, lags, p_value })
    }
}

impl<const M: usize> Innovation<M> {
    /// [`normalised`](Self::normalised) as [`Whiteness`] takes it: without the components that
    /// `observation` misses.
    #[must_use]
    pub fn normalised_present(
        &self,
        observation: &foxhunt_core::Observation<M>,
    ) -> Option<SVector<Option<f64>, M>> {
        let white = self.normalised()?;
        Some(SVector::from_fn(|i, _| observation.has(i).then_some(white[i])))
    }
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use nalgebra::{Vector1, Vector2};
    use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
    use rand_distr::StandardNormal;

    use super::*;

    #[test]
    fn a_short_run_by_hand() {
        let mut whiteness = Whiteness::new(3);
        whiteness.add_run(&[1.0, -2.0, 3.0].map(|v| Vector1::new(Some(v))));
        let correlations: Vec<_> = whiteness.autocorrelations().collect();
        assert_eq!(correlations.len(), 2, "there is no pair three apart");
        // (−2 − 6) / 14 and 3 / 14; variances 2 / 15 and 1 / 15.
        assert!((correlations[0].rho + 8.0 / 14.0).abs() < 1e-15 && correlations[0].lag == 1);
        assert!((correlations[1].rho - 3.0 / 14.0).abs() < 1e-15 && correlations[1].lag == 2);
        assert_abs_diff_eq!(
            correlations[0].sigma * correlations[0].sigma,
            2.0 / 15.0,
            epsilon = 1e-15
        );
        let test = whiteness.ljung_box().expect("pairs");
        let statistic = (64.0 / 2.0 + 9.0) / 196.0 * 15.0;
        assert!(abs_diff_eq!(test.statistic, statistic, epsilon = 1e-12) && test.lags == 2);
        // χ² of two degrees of freedom exceeds q with exp(−q / 2).
        assert_abs_diff_eq!(test.p_value, libm::exp(-0.5 * statistic), epsilon = 1e-9);
        assert_eq!(Whiteness::new(3).ljung_box(), None);
    }

    #[test]
    fn missing_numbers_make_no_pairs_and_keep_their_place() {
        let gap = [Some(1.0), None, Some(2.0)].map(Vector1::new);
        let mut whiteness = Whiteness::new(2);
        whiteness.add_run(&gap);
        let correlations: Vec<_> = whiteness.autocorrelations().collect();
        assert_eq!(correlations.len(), 1);
        assert!(correlations[0].lag == 2 && (correlations[0].rho - 0.4).abs() < 1e-15);
        // Two runs make no pair between them.
        let mut apart = Whiteness::new(2);
        apart.add_run(&gap[..1]);
        apart.add_run(&gap[2..]);
        assert_eq!(apart.autocorrelations().count(), 0);
    }

    /// Returns the share of 2000 runs of 40 that fail at 5 %. Each of two components is
    /// `colour` of its previous value and an independent normal number; a fifth is missing.
    fn failing(colour: impl Fn(f64, f64) -> f64) -> f64 {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
        let mut failed = 0.0;
        for _ in 0..2000 {
            let mut before = [0.0; 2];
            let run: Vec<Vector2<Option<f64>>> = (0..40)
                .map(|_| {
                    Vector2::from_fn(|i, _| {
                        let drawn: f64 = rng.sample(StandardNormal);
                        before[i] = colour(before[i], drawn);
                        (rng.random::<f64>() > 0.2).then_some(before[i])
                    })
                })
                .collect();
            let mut whiteness = Whiteness::new(5);
            whiteness.add_run(&run);
            failed += f64::from(u8::from(whiteness.ljung_box().expect("pairs").p_value < 0.05));
        }
        failed / 2000.0
    }

    #[test]
    fn white_passes_and_coloured_or_biased_fails() {
        // 3.3 standard errors of a share of 0.05 of 2000, and what the χ² is off for 5 lags of 64
        // numbers: a hundredth.
        let white = failing(|_, drawn| drawn);
        assert_abs_diff_eq!(white, 0.05, epsilon = 0.026);
        assert!(failing(|before, drawn| 0.5 * before + drawn) > 0.7);
        assert!(failing(|_, drawn| 0.6 + drawn) > 0.7);
    }
}
