use foxhunt_core::{Axis, EstimatorError, noise::log_add};
use nalgebra::SMatrix;

use crate::{Gaussian, triangle};

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
    use foxhunt_core::{Estimate, Role};
    use nalgebra::{Matrix2, Vector2};

    use super::*;

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
        assert!((log_evidence - libm::log(0.1)).abs() < 1e-15);
        let belief = belief.estimate();
        assert!((belief.mean - Vector2::new(1.2, 0.4)).norm() < 1e-14);
        // 0.4 P⁺ + 0.6 P + 0.24 d dᵀ with d = (3, 1).
        let covariance = Matrix2::new(0.4 + 2.4 + 2.16, 0.2 + 0.72, 0.2 + 0.72, 1.0 + 0.24);
        assert!((belief.covariance - covariance).norm() < 1e-13, "{}", belief.covariance);
    }
}
