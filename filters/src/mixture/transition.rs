use alloc::{vec, vec::Vec};

use foxhunt_core::{EstimatorError, parameter::require};

use crate::count::number;

/// Markov chain of a target's modes of motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Transition {
    modes: usize,
    /// Row by row: a stochastic matrix for a step, or a generator in 1 / s.
    matrix: Vec<f64>,
    per: Per,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Per {
    Step,
    Second,
}

impl Transition {
    /// One change at each `predict` of a positive time step, however long: `matrix[i][j]` is the
    /// probability of mode j after mode i.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when there is no mode, the matrix is not square, an entry is
    /// negative or a row does not sum to 1 (to 10⁻⁹).
    pub fn per_step(matrix: &[&[f64]]) -> Result<Self, EstimatorError> {
        let modes = matrix.len();
        let name = "transition matrix";
        require(modes > 0, name, 0.0, "of at least one mode")?;
        for row in matrix {
            require(row.len() == modes, name, number(row.len()), "square")?;
            for entry in *row {
                require(*entry >= 0.0, name, *entry, "of non-negative entries")?;
            }
            let sum: f64 = row.iter().sum();
            require((sum - 1.0).abs() <= 1e-9, name, sum, "of rows that sum to 1")?;
        }
        Ok(Self { modes, matrix: matrix.concat(), per: Per::Step })
    }

    /// Changes at any time: mode i lasts `seconds[i]` on average, exponentially distributed, and is
    /// followed by each of the others with the same probability. Two steps change as much as one
    /// of their length together.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when there is no mode or a mean is not positive; it may be
    /// infinite.
    pub fn sojourn(seconds: &[f64]) -> Result<Self, EstimatorError> {
        let modes = seconds.len();
        require(modes > 0, "modes", 0.0, "at least 1")?;
        let mut matrix = vec![0.0; modes * modes];
        for (i, mean) in seconds.iter().enumerate() {
            require(*mean > 0.0, "sojourn time", *mean, "positive")?;
            for j in (0..modes).filter(|j| *j != i) {
                matrix[i * modes + j] = 1.0 / mean / number(modes - 1);
                matrix[i * modes + i] -= 1.0 / mean / number(modes - 1);
            }
        }
        Ok(Self { modes, matrix, per: Per::Second })
    }

    /// Returns the number of modes.
    #[must_use]
    pub fn modes(&self) -> usize {
        self.modes
    }

    /// The probability of each mode after each other over `dt` > 0 seconds, row by row.
    pub(super) fn over(&self, dt: f64) -> Vec<f64> {
        match self.per {
            Per::Step => self.matrix.clone(),
            Per::Second => self.exponential(dt),
        }
    }

    /// exp(G Δt) by uniformisation (Jensen 1953): with the fastest rate λ and the stochastic
    /// U = I + G / λ it is Σ e^(−λΔt) (λΔt)ᵏ / k! Uᵏ, a sum of non-negative terms; over a time in
    /// which λ Δt ≤ 1, then squared as often as that was halved.
    fn exponential(&self, dt: f64) -> Vec<f64> {
        let n = self.modes;
        let fastest = (0..n).map(|i| -self.matrix[i * n + i]).fold(0.0, f64::max);
        let identity: Vec<f64> =
            (0..n * n).map(|k| if k / n == k % n { 1.0 } else { 0.0 }).collect();
        if fastest <= 0.0 {
            return identity;
        }
        // After 60 doublings of the shortest sojourn nothing is left of the beginning.
        let mut jumps = libm::fmin(fastest * dt, 1e18);
        let mut doublings = 0;
        while jumps > 1.0 {
            jumps *= 0.5;
            doublings += 1;
        }
        let uniform: Vec<f64> =
            identity.iter().zip(&self.matrix).map(|(one, g)| one + g / fastest).collect();
        let mut term = identity;
        let mut sum = vec![0.0; n * n];
        let mut weight = libm::exp(-jumps);
        // 1 / 20! is below the last place.
        for k in 0..20 {
            sum.iter_mut().zip(&term).for_each(|(s, t)| *s += t * weight);
            term = product(&term, &uniform, n);
            weight *= jumps / number(k + 1);
        }
        // Squaring doubles what a row has lost to rounding.
        rescale(&mut sum, n);
        for _ in 0..doublings {
            sum = product(&sum, &sum, n);
            rescale(&mut sum, n);
        }
        sum
    }
}

/// Makes every row sum to 1.
fn rescale(matrix: &mut [f64], n: usize) {
    for row in matrix.chunks_mut(n) {
        let sum: f64 = row.iter().sum();
        row.iter_mut().for_each(|p| *p /= sum);
    }
}

fn product(a: &[f64], b: &[f64], n: usize) -> Vec<f64> {
    (0..n * n).map(|k| (0..n).map(|m| a[k / n * n + m] * b[m * n + k % n]).sum()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_modes_relax_exponentially() {
        // P₁₁(t) = π₁ + (1 − π₁) e^(−(a + b) t) with a = 1/10, b = 1/40, π₁ = b / (a + b).
        let chain = Transition::sojourn(&[10.0, 40.0]).expect("positive");
        for dt in [1e-6, 0.5, 8.0, 300.0, 1e300] {
            let over = chain.over(dt);
            let at_rest = 0.2;
            let left = libm::exp(-0.125 * dt);
            let expected =
                [at_rest + 0.8 * left, 0.8 - 0.8 * left, 0.2 - 0.2 * left, 0.8 + 0.2 * left];
            for (p, e) in over.iter().zip(expected) {
                assert!((p - e).abs() < 1e-12, "{dt} s: {over:?}, not {expected:?}");
            }
        }
    }

    #[test]
    fn two_steps_are_one_of_their_length() {
        let chain = Transition::sojourn(&[3.0, 20.0, f64::INFINITY]).expect("positive");
        let two = product(&chain.over(1.3), &chain.over(2.2), 3);
        let one = chain.over(3.5);
        assert!(two.iter().zip(&one).all(|(a, b)| (a - b).abs() < 1e-14), "{two:?} {one:?}");
        assert_eq!(&one[6..], [0.0, 0.0, 1.0], "what lasts for ever");
    }

    #[test]
    fn chains_that_are_none_are_refused() {
        assert!(Transition::per_step(&[&[0.9, 0.1], &[0.3, 0.7]]).is_ok());
        for bad in [[&[0.9, 0.2][..], &[0.3, 0.7]], [&[1.1, -0.1], &[0.0, 1.0]], [&[1.0], &[1.0]]] {
            assert!(Transition::per_step(&bad).is_err(), "{bad:?}");
        }
        assert!(
            Transition::per_step(&[&[f64::NAN]]).is_err() && Transition::per_step(&[]).is_err()
        );
        for bad in [0.0, -1.0, f64::NAN] {
            assert!(Transition::sojourn(&[1.0, bad]).is_err(), "{bad}");
        }
        assert!(Transition::sojourn(&[]).is_err());
    }
}
