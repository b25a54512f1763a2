use rand::{Rng, RngExt};

use crate::count::number;

/// How a particle filter draws the ancestors of its next generation. Each scheme draws a particle
/// of weight w n w times on average.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Resampling {
    /// One draw, then equal strides (Kitagawa 1996): a particle comes ⌊n w⌋ or ⌈n w⌉ times, and
    /// little noise is added.
    #[default]
    Systematic,
    /// Independent draws (Gordon, Salmond & Smith 1993): what most theorems are about.
    Multinomial,
}

impl Resampling {
    /// Fills `ancestors` with indices into `weights`, which sum to 1; those of weight 0 are never
    /// drawn.
    pub(super) fn draw(self, weights: &[f64], rng: &mut impl Rng, ancestors: &mut [usize]) {
        match self {
            Self::Systematic => systematic(weights, rng, ancestors),
            Self::Multinomial => multinomial(weights, rng, ancestors),
        }
    }
}

fn systematic(weights: &[f64], rng: &mut impl Rng, ancestors: &mut [usize]) {
    let count = number(ancestors.len());
    let start: f64 = rng.random();
    let mut walk = Walk::new(weights);
    for (i, ancestor) in ancestors.iter_mut().enumerate() {
        *ancestor = walk.to((number(i) + start) / count);
    }
}

fn multinomial(weights: &[f64], rng: &mut impl Rng, ancestors: &mut [usize]) {
    // Uniform numbers in order, without sorting: the largest of k is distributed as U^(1/k), the
    // others as k − 1 uniform numbers below it (Devroye 1986, §V.3.1). Taken from 1 downwards,
    // as 1 − u is uniform too, they ascend.
    let mut below = 1.0;
    let mut walk = Walk::new(weights);
    let count = ancestors.len();
    for (i, ancestor) in ancestors.iter_mut().enumerate() {
        let draw: f64 = 1.0 - rng.random::<f64>();
        below *= libm::exp(libm::log(draw) / number(count - i));
        *ancestor = walk.to(1.0 - below);
    }
}

/// A walk up the cumulative sum of weights.
struct Walk<'a> {
    weights: &'a [f64],
    at: usize,
    reach: f64,
    /// The last particle that can be drawn: the sum may round to less than 1.
    last: usize,
}

impl<'a> Walk<'a> {
    fn new(weights: &'a [f64]) -> Self {
        let last = weights.iter().rposition(|w| *w > 0.0).unwrap_or(0);
        let reach = weights.first().copied().unwrap_or(0.0);
        Self { weights, at: 0, reach, last }
    }

    /// The particle whose share of [0, 1) holds `mark`; marks ascend.
    fn to(&mut self, mark: f64) -> usize {
        while self.reach <= mark && self.at < self.last {
            self.at += 1;
            self.reach += self.weights[self.at];
        }
        self.at
    }
}

#[cfg(test)]
mod tests {
    use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

    use super::*;

    const WEIGHTS: [f64; 6] = [0.0, 0.05, 0.4, 0.3, 0.25, 0.0];

    /// How often each particle is drawn, on average over 20 000 draws from seed 1; `each` sees
    /// the counts of one.
    fn mean_counts(scheme: Resampling, mut each: impl FnMut(&[u32; 6])) -> [f64; 6] {
        const DRAWS: u32 = 20_000;
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let mut totals = [0.0; 6];
        for _ in 0..DRAWS {
            let mut ancestors = [usize::MAX; 6];
            scheme.draw(&WEIGHTS, &mut rng, &mut ancestors);
            assert!(ancestors.is_sorted());
            let mut counts = [0; 6];
            for ancestor in ancestors {
                counts[ancestor] += 1;
            }
            each(&counts);
            for (total, count) in totals.iter_mut().zip(counts) {
                *total += f64::from(count) / f64::from(DRAWS);
            }
        }
        totals
    }

    #[test]
    fn systematic_is_even_and_unbiased() {
        let means = mean_counts(Resampling::Systematic, |counts| {
            for (weight, count) in WEIGHTS.iter().zip(counts) {
                assert!((f64::from(*count) - 6.0 * weight).abs() < 1.0, "{count} of {weight}");
            }
        });
        for (weight, mean) in WEIGHTS.iter().zip(means) {
            // Beyond its floor a count is Bernoulli: σ ≤ 0.5 / √20 000; five of them, so a false
            // alarm comes once in 3 million runs.
            assert!((mean - 6.0 * weight).abs() < 5.0 * 0.5 / libm::sqrt(20_000.0), "{mean}");
        }
    }

    #[test]
    fn multinomial_counts_are_binomial() {
        let mut squares = [0.0; 6];
        let means = mean_counts(Resampling::Multinomial, |counts| {
            for (square, (weight, count)) in squares.iter_mut().zip(WEIGHTS.iter().zip(counts)) {
                let off = f64::from(*count) - 6.0 * weight;
                *square += off * off / 20_000.0;
            }
        });
        for ((weight, mean), square) in WEIGHTS.iter().zip(means).zip(squares) {
            let variance = 6.0 * weight * (1.0 - weight);
            let band = 5.0 * libm::sqrt(variance / 20_000.0);
            assert!((mean - 6.0 * weight).abs() <= band, "{mean} of {weight}");
            // The variance of a squared deviation is at most 3 of its square here, by the
            // binomial's kurtosis 3 + (1 − 6 w (1 − w)) / variance.
            let kurtosis = 3.0 + (1.0 - 6.0 * weight * (1.0 - weight)) / variance.max(1e-9);
            let band = 5.0 * variance * libm::sqrt((kurtosis - 1.0) / 20_000.0);
            assert!((square - variance).abs() <= band, "variance {square}, not {variance}");
        }
    }
}
