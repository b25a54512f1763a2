use alloc::collections::BTreeSet;

use foxhunt_core::{
    EstimatorError, State,
    parameter::{positive, require},
};
use statrs::distribution::{ContinuousCDF, Normal};

use crate::count::number;

/// Number of particles that a cloud needs: KLD-sampling (Fox 2003).
///
/// Space is divided into bins, and particles are drawn until there are so many that, with the
/// stated probability, the Kullback-Leibler divergence between the cloud's histogram and the true
/// one is below `error`. A belief that is spread out takes many particles, one that is narrow
/// few: with k bins occupied and the normal quantile z,
/// n = (k − 1) / 2ε · (1 − 2/(9 (k − 1)) + √(2/(9 (k − 1))) z)³ (Fox 2003, eq. 7).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KldSampling<const N: usize> {
    bins: State<N>,
    least: usize,
    most: usize,
    error: f64,
    quantile: f64,
}

impl<const N: usize> KldSampling<N> {
    /// Bins of these sides in the components' units, infinite for a component that shall not
    /// matter, and between `least` and `most` particles; an error of 0.05 with a probability of
    /// 0.99 (Fox 2003, §4.2).
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when a side is not positive, there are not at least N + 1
    /// particles, or `most` is below `least`.
    pub fn new(bins: State<N>, least: usize, most: usize) -> Result<Self, EstimatorError> {
        for side in &bins {
            require(*side > 0.0, "side of a bin", *side, "positive")?;
        }
        let enough = "more than the state has components";
        require(least > N, "least particles", number(least), enough)?;
        require(most >= least, "most particles", number(most), "at least the least")?;
        Ok(Self { bins, least, most, error: 0.05, quantile: 2.326_347_874_040_841 })
    }

    /// Sets the error ε, and the probability with which it is met.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when the error is not positive or the probability not in
    /// [0.5, 1).
    pub fn with_error(self, error: f64, probability: f64) -> Result<Self, EstimatorError> {
        positive("KLD error", error)?;
        let inside = (0.5..1.0).contains(&probability);
        require(inside, "KLD probability", probability, "in [0.5, 1)")?;
        Ok(Self { error, quantile: Normal::standard().inverse_cdf(probability), ..self })
    }

    /// Returns the number of particles for a number of occupied bins.
    #[must_use]
    pub fn particles(&self, occupied: usize) -> usize {
        let degrees = number(occupied.saturating_sub(1));
        if degrees <= 0.0 {
            return self.least;
        }
        // χ² by its cube root (Wilson & Hilferty 1931).
        let spread = 2.0 / (9.0 * degrees);
        let root = 1.0 - spread + libm::sqrt(spread) * self.quantile;
        let wanted = libm::ceil(degrees / (2.0 * self.error) * root * root * root);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a number that is too large saturates, and is cut to the most"
        )]
        let wanted = wanted as usize;
        wanted.clamp(self.least, self.most)
    }

    pub(super) fn bins(&self) -> Bins<N> {
        Bins { sides: self.bins, occupied: BTreeSet::new() }
    }
}

/// The bins that particles lie in.
pub(super) struct Bins<const N: usize> {
    sides: State<N>,
    occupied: BTreeSet<[i64; N]>,
}

impl<const N: usize> Bins<N> {
    /// Notes a particle; true if it is the first of its bin.
    pub(super) fn add(&mut self, state: &State<N>) -> bool {
        #[expect(clippy::cast_possible_truncation, reason = "a place beyond 2⁶³ bins saturates")]
        let bin = core::array::from_fn(|row| libm::floor(state[row] / self.sides[row]) as i64);
        self.occupied.insert(bin)
    }

    pub(super) fn count(&self) -> usize {
        self.occupied.len()
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use nalgebra::Vector2;

    use super::*;

    #[test]
    fn the_number_of_particles_is_a_quantile() {
        let kld = KldSampling::new(Vector2::repeat(1.0), 10, 1_000_000).expect("in range");
        // χ² at 0.99 over 2 ε = 0.1 (Abramowitz & Stegun 1964, table 26.8); the cube root is good
        // to a hundredth from one degree of freedom on.
        for (occupied, chi_squared) in [(2, 6.634_90), (11, 23.2093), (101, 135.807)] {
            let count = number(kld.particles(occupied));
            assert!((count / (10.0 * chi_squared) - 1.0).abs() < 0.015, "{occupied}: {count}");
        }
        assert_eq!((kld.particles(0), kld.particles(1)), (10, 10));
        assert_eq!(kld.particles(usize::MAX), 1_000_000);
        let coarse = kld.with_error(0.1, 0.95).expect("in range");
        // χ²₁₀ at 0.95, over 0.2.
        assert_abs_diff_eq!(number(coarse.particles(11)) / (5.0 * 18.307), 1.0, epsilon = 0.015);
    }

    #[test]
    fn what_is_out_of_range_is_refused() {
        let make = |side: f64, least, most| KldSampling::new(Vector2::new(1.0, side), least, most);
        assert!(make(f64::INFINITY, 3, 3).is_ok());
        assert!(make(0.0, 10, 100).is_err() && make(f64::NAN, 10, 100).is_err());
        assert!(make(1.0, 2, 100).is_err() && make(1.0, 100, 99).is_err());
        let kld = make(1.0, 10, 100).expect("in range");
        assert!(kld.with_error(0.0, 0.9).is_err() && kld.with_error(0.1, 1.0).is_err());
    }

    #[test]
    fn bins_are_half_open_and_infinite_ones_hold_all() {
        let kld = KldSampling::new(Vector2::new(2.0, f64::INFINITY), 10, 100).expect("in range");
        let mut bins = kld.bins();
        let new = [[-0.1, 5.0], [0.0, -5.0], [1.99, 1e300], [2.0, 0.0], [-2.0, 0.0]]
            .map(|place| bins.add(&Vector2::from(place)));
        assert_eq!(new, [true, true, false, true, false]);
        assert_eq!(bins.count(), 3);
    }
}
