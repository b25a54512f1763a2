use foxhunt_core::{Axis, EstimatorError, noise::OutlierMixture};
use nalgebra::SMatrix;

use crate::{Gaussian, triangle};

/// What an observation makes of a belief when it may be an outlier that says nothing: the mixture
/// of the posterior and the prior, as the Gaussian of its two moments, and the mixture's
/// log-evidence (Bar-Shalom & Tse 1975, for one measurement).
///
/// `log_evidence` is that of an observation which is none. The covariance is a sum of squares:
/// the two factors, each times the root of its probability, and the way between the means.
pub(super) fn doubt<const N: usize>(
    prior: &Gaussian<N>,
    posterior: &Gaussian<N>,
    log_evidence: f64,
    outliers: &OutlierMixture,
    axes: &[Axis; N],
) -> Result<(Gaussian<N>, f64), EstimatorError> {
    let mixture = outliers.log_density(log_evidence);
    let sound = libm::exp(libm::log1p(-outliers.share()) + log_evidence - mixture).min(1.0);
    let step = Axis::difference(axes, posterior.mean(), prior.mean());
    let mut factor: SMatrix<f64, N, N> = posterior.factor() * libm::sqrt(sound);
    for column in prior.factor().column_iter() {
        triangle::add_to_lower(&mut factor, column * libm::sqrt(1.0 - sound));
    }
    triangle::add_to_lower(&mut factor, step * libm::sqrt(sound * (1.0 - sound)));
    let belief = Gaussian::from_factor(prior.mean() + step * sound, factor, axes)?;
    Ok((belief, mixture))
}
