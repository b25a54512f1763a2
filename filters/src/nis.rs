use foxhunt_core::{Covariance, Estimate, MeasurementModel, Observation, State};
use nalgebra::SVector;

/// yᵀ S⁻¹ y with the moments of what weighted states expect: deviations are taken about what is
/// expected at their mean, as a Kalman filter's are about its centre. `None` where the model
/// expects nothing finite.
pub(crate) fn moment_matched_nis<H, const N: usize, const M: usize>(
    measurement: &H,
    observation: &Observation<M>,
    belief: &Estimate<N>,
    states: impl Iterator<Item = (State<N>, f64)>,
) -> Option<f64>
where
    H: MeasurementModel<N, M>,
{
    let expected = |x: &State<N>| measurement.expected(x, observation.receiver());
    let centre = expected(&belief.mean);
    let (mut shift, mut square) = (SVector::<f64, M>::zeros(), Covariance::<M>::zeros());
    for (state, weight) in states {
        let deviation = measurement.residual(&expected(&state), &centre);
        shift += deviation * weight;
        square += deviation * (deviation * weight).transpose();
    }
    let spread = square - shift * shift.transpose();
    let residual = measurement.residual(observation.value(), &(centre + shift));
    let residual = observation.mask(residual.transpose()).transpose();
    let spread = observation.mask(observation.mask(spread).transpose());
    let factor = (spread + observation.noise()).cholesky()?;
    Some(residual.dot(&factor.solve(&residual))).filter(|nis| nis.is_finite())
}
