//! Beliefs over moments alone, and after an observation that may be an outlier.

use foxhunt_core::{
    Axis, Estimate, EstimatorError, Observation, State, elementary,
    noise::{self, log_add},
};
use nalgebra::{SMatrix, SVector};

use crate::{Gaussian, Moments, triangle};

/// Least share of a variance that may remain given other components: below it, six of its sixteen
/// digits are lost.
const LEAST: f64 = 1e-6;

/// The belief of a filter: its moments, and a factor of the covariance only where that is so thin
/// that the covariance's own digits would not do.
///
/// A step over moments alone is the shortest, but takes differences; one over factors
/// ([`Regression`](super::Regression)) takes none. So a step is first tried over
/// moments, and what it comes to is kept if no variance fell below [`LEAST`] of what it was,
/// given the components before it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Belief<const N: usize> {
    estimate: Estimate<N>,
    factor: Option<SMatrix<f64, N, N>>,
}

impl<const N: usize> Belief<N> {
    pub(super) fn estimate(&self) -> &Estimate<N> {
        &self.estimate
    }

    /// The belief with its factor; `None` where it has none.
    pub(super) fn gaussian(&self) -> Option<Gaussian<N>> {
        match self.factor {
            Some(factor) => Some(Gaussian::with_factor(self.estimate, factor)),
            None => Gaussian::factored(self.estimate),
        }
    }

    /// The moments, where these are all there is to it.
    #[inline(always)]
    pub(super) fn moments(&self) -> Option<&Estimate<N>> {
        self.factor.is_none().then_some(&self.estimate)
    }

    /// Puts these moments in the place of plain ones.
    #[inline(always)]
    pub(super) fn replace(&mut self, moments: &Estimate<N>) {
        self.estimate = *moments;
    }
}

/// A Gaussian keeps its factor only where it needs it.
impl<const N: usize> From<Gaussian<N>> for Belief<N> {
    fn from(gaussian: Gaussian<N>) -> Self {
        let estimate = *gaussian.estimate();
        let plain = is_plain(&estimate, &estimate.covariance.diagonal());
        Self { estimate, factor: (!plain).then_some(*gaussian.factor()) }
    }
}

/// An update over moments.
pub(super) struct Conditioned<const N: usize> {
    pub posterior: Estimate<N>,
    /// yᵀ S⁻¹ y.
    pub nis: f64,
    /// |S|.
    determinant: f64,
}

impl<const N: usize> Conditioned<N> {
    /// Conditions `prior` on an observation that differs by `residual` from its expectation:
    /// eliminates the observation's components from the covariance of both, one after the other
    /// (the Schur complement of S). `None` where that would lose digits.
    #[inline(always)]
    pub(super) fn on<const M: usize>(
        prior: &Estimate<N>,
        expected: &Moments<N, M>,
        residual: SVector<f64, M>,
        observation: &Observation<M>,
        axes: &[Axis; N],
    ) -> Option<Self> {
        let Estimate { mut mean, mut covariance } = *prior;
        let mut y = observation.strike(residual);
        let mut cross = observation.mask(expected.cross);
        let explained = observation.mask(observation.strike(expected.covariance));
        let mut s = explained + observation.noise();
        let least = s.diagonal() * LEAST;

        let mut nis = 0.0;
        let mut determinant = 1.0;
        let mut plain = true;
        for k in 0..M {
            let pivot = s[(k, k)];
            plain &= pivot > least[k];
            determinant *= pivot;
            let inverse = 1.0 / pivot;
            let column = cross.column(k).into_owned();
            let share = y[k] * inverse;
            nis += y[k] * share;
            mean += column * share;
            for j in 0..N {
                let along = column[j] * inverse;
                for i in j..N {
                    covariance[(i, j)] -= column[i] * along;
                }
            }
            for j in k + 1..M {
                let along = s[(j, k)] * inverse;
                y[j] -= along * y[k];
                for i in 0..N {
                    cross[(i, j)] -= along * column[i];
                }
                for i in j..M {
                    s[(i, j)] -= along * s[(i, k)];
                }
            }
        }
        mean = Axis::difference(axes, &mean, &State::zeros());
        covariance.fill_upper_triangle_with_lower_triangle();
        let posterior = Estimate { mean, covariance };
        // One product for all of it: a sum that overflows only takes the way over factors, too.
        plain &= triangle::pivots_exceed(covariance, &(prior.covariance.diagonal() * LEAST))
            && determinant >= f64::MIN_POSITIVE
            && 0.0 * (mean.sum() + determinant + nis) <= 0.0;
        plain.then_some(Self { posterior, nis, determinant })
    }

    /// ln N(y; 0, S) of `dof` components.
    #[inline(always)]
    pub(super) fn log_evidence(&self, dof: usize) -> f64 {
        noise::log_density(self.nis, 0.5 * elementary::ln(self.determinant), dof)
    }
}

/// Returns true if all is finite, and no variance, given the components before it, is below
/// [`LEAST`] of `variances`.
#[inline(always)]
pub(super) fn is_plain<const N: usize>(moments: &Estimate<N>, variances: &SVector<f64, N>) -> bool {
    let finite = triangle::nan_unless_finite(&moments.mean) <= 0.0;
    triangle::pivots_exceed(moments.covariance, &(variances * LEAST)) && finite
}

/// The belief after an observation that may be an outlier: the mixture of the posterior and the
/// prior, as the Gaussian of its two moments, and the mixture's log-evidence (Bar-Shalom & Tse
/// 1975, for one measurement).
///
/// The logarithms are of the evidence of a sound observation and of an outlier, each with its
/// share. The covariance is a sum of squares: the two factors, each times the root of its
/// probability, and the difference of the means.
pub(super) fn mix<const N: usize>(
    prior: &Gaussian<N>,
    posterior: &Gaussian<N>,
    [log_sound, log_outlier]: [f64; 2],
    axes: &[Axis; N],
) -> Result<(Gaussian<N>, f64), EstimatorError> {
    let log_evidence = log_add(log_sound, log_outlier);
    let sound = libm::exp(log_sound - log_evidence).min(1.0);
    let step = Axis::difference(axes, posterior.mean(), prior.mean());
    let mut between = SMatrix::<f64, N, N>::zeros();
    between.set_column(0, &(step * libm::sqrt(sound * (1.0 - sound))));
    let parts = [posterior.factor() * libm::sqrt(sound), prior.factor() * libm::sqrt(1.0 - sound)];
    let factor = triangle::lower_root([parts[0], parts[1], between]);
    let belief = Gaussian::from_factor(prior.mean() + step * sound, factor, axes)?;
    Ok((belief, log_evidence))
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_core::{Estimate, Pose, Role};
    use nalgebra::{Matrix2, Vector2};

    use super::*;

    fn given(noise: Matrix2<f64>, missing: Option<usize>) -> Option<(Conditioned<2>, f64)> {
        let covariance = Matrix2::new(9.0, 2.0, 2.0, 4.0);
        let prior = Estimate { mean: Vector2::new(1.0, -2.0), covariance };
        let slope = Matrix2::new(0.5, -1.0, 0.2, 0.7);
        let (cross, explained) =
            (covariance * slope.transpose(), slope * covariance * slope.transpose());
        let expected = Moments { mean: slope * prior.mean, cross, covariance: explained };
        let residual = Vector2::new(0.4, -1.1);
        let observation = Observation::new(0.0, Pose::default(), expected.mean + residual, noise);
        let observation = observation.expect("proper");
        let observation = missing.map_or(observation, |component| observation.without(component));
        let linear = [Axis::Linear; 2];
        let conditioned = Conditioned::on(&prior, &expected, residual, &observation, &linear)?;
        // The textbook's, of what is present.
        let cross = observation.mask(cross);
        let residual = observation.strike(residual);
        let s = observation.mask(observation.strike(explained)) + observation.noise();
        let gain = cross * s.try_inverse().expect("definite");
        let off = (conditioned.posterior.mean - prior.mean - gain * residual).norm()
            + (conditioned.posterior.covariance - covariance + gain * cross.transpose()).norm()
            + (conditioned.determinant - s.determinant()).abs();
        Some((conditioned, off))
    }

    #[test]
    fn elimination_is_the_textbooks_update() {
        let noise = Matrix2::new(2.0, 0.3, 0.3, 1.0);
        for missing in [None, Some(0), Some(1)] {
            let (conditioned, off) = given(noise, missing).expect("far from singular");
            assert!(off < 1e-13, "without {missing:?} off by {off}");
            let covariance = conditioned.posterior.covariance;
            assert_eq!(covariance, covariance.transpose());
        }
    }

    #[test]
    fn what_would_lose_digits_is_left_to_factors() {
        assert!(given(Matrix2::from_diagonal_element(1e-3), None).is_some());
        for thin in [Matrix2::from_diagonal_element(1e-7), Matrix2::new(1.0, 0.0, 0.0, 1e-9)] {
            assert!(given(thin, None).is_none(), "{thin}");
        }
        let covariance = Matrix2::new(1.0, 1.0, 1.0, 1.0 + 1e-7);
        let thin = Estimate { mean: Vector2::zeros(), covariance };
        let thin = Gaussian::new(thin, Role::Prior).expect("definite");
        assert!(Belief::from(thin).moments().is_none());
        assert_eq!(Belief::from(thin).gaussian(), Some(thin));
        let wide = Gaussian::new(Estimate::isotropic(Vector2::zeros(), 3.0), Role::Prior);
        assert!(Belief::from(wide.expect("definite")).moments().is_some());
    }

    #[test]
    fn the_moments_are_those_of_the_mixture() {
        let gaussian = |mean, covariance| {
            Gaussian::new(Estimate { mean, covariance }, Role::Prior).expect("definite")
        };
        let prior = gaussian(Vector2::zeros(), Matrix2::new(4.0, 0.0, 0.0, 1.0));
        let posterior = gaussian(Vector2::new(3.0, 1.0), Matrix2::new(1.0, 0.5, 0.5, 1.0));
        let share = 0.4;
        let axes = [Axis::Linear; 2];
        let logs = [libm::log(share * 0.1), libm::log((1.0 - share) * 0.1)];
        let (belief, log_evidence) = mix(&prior, &posterior, logs, &axes).expect("definite");
        assert_abs_diff_eq!(log_evidence, libm::log(0.1), epsilon = 1e-15);
        let belief = belief.estimate();
        assert!((belief.mean - Vector2::new(1.2, 0.4)).norm() < 1e-14);
        // 0.4 P⁺ + 0.6 P + 0.24 d dᵀ with d = (3, 1).
        let covariance = Matrix2::new(0.4 + 2.4 + 2.16, 0.2 + 0.72, 0.2 + 0.72, 1.0 + 0.24);
        assert!((belief.covariance - covariance).norm() < 1e-13, "{}", belief.covariance);
    }
}
