//! The Gaussian that is reported of an optimum.

use foxhunt_core::{Covariance, Estimate, MeasurementModel, State};

use super::{
    BatchError,
    curvature::{LEAST_RCOND, reciprocal_condition},
    iteration::End,
    problem::Problem,
};
use crate::{Gaussian, count::number};

/// A direction is open where the observations hold less than this share of the prior's
/// information.
const OPEN: f64 = 0.1;

/// The observations are curved along an open direction where one standard deviation of the prior
/// costs more than this on either side; a quadratic cost would rise by half of [`OPEN`].
const CURVED: f64 = 0.25;

/// The optimum with the inverse of its information.
pub(super) fn laplace<const N: usize>(end: &End<N>) -> Result<Estimate<N>, BatchError> {
    let factor = end.information.cholesky().ok_or(BatchError::Flat { rcond: 0.0 })?;
    let covariance = factor.solve(&Covariance::<N>::identity());
    Ok(Estimate { mean: end.state, covariance: (covariance + covariance.transpose()) * 0.5 })
}

/// The optimum with the inverse of its information; or, where the observations leave a direction
/// open along which they are curved, with the prior's spread about the optimum, P + δ δᵀ with
/// δ the optimum less the prior's mean.
///
/// Levels that were all taken at one place have a ring for a likelihood. The information at its
/// optimum knows the range, and the tangent, which leaves the ring: the target, anywhere on the
/// ring, would be thousands of such standard deviations away. The prior's spread covers it.
///
/// # Errors
///
/// [`BatchError::Flat`] where such a direction is open and there is no prior.
pub(super) fn posterior<H, const N: usize, const M: usize>(
    problem: &Problem<'_, H, N, M>,
    end: &End<N>,
) -> Result<Estimate<N>, BatchError>
where
    H: MeasurementModel<N, M>,
{
    let estimate = laplace(end)?;
    let Some(prior) = problem.prior else {
        // The Hessian of such a ring is rounding along it; the outer products are exactly singular.
        let rcond = reciprocal_condition(&problem.local(&end.state).information);
        return if rcond < LEAST_RCOND { Err(BatchError::Flat { rcond }) } else { Ok(estimate) };
    };
    if !is_curved(problem, prior, &end.state) {
        return Ok(estimate);
    }
    let shift = end.state - prior.mean();
    let covariance = prior.estimate().covariance + shift * shift.transpose();
    Ok(Estimate { covariance, ..estimate })
}

/// Returns true if the observations leave a direction open along which their cost is not quadratic.
fn is_curved<H, const N: usize, const M: usize>(
    problem: &Problem<'_, H, N, M>,
    prior: &Gaussian<N>,
    x: &State<N>,
) -> bool
where
    H: MeasurementModel<N, M>,
{
    let alone = Problem { prior: None, ..*problem };
    let here = alone.local(x);
    // In units of the prior the posterior's covariance is (I + A)⁻¹; its largest eigenvalue is
    // that of the direction that is the most open.
    let information = prior.factor().transpose() * here.information * prior.factor();
    let Some(factor) = (Covariance::<N>::identity() + information).cholesky() else { return false };
    // Of uneven entries, so that it is along no axis and across none.
    let mut direction = State::<N>::from_fn(|i, _| 1.0 + 0.37 * number(i));
    for _ in 0..50 {
        direction = factor.solve(&direction).normalize();
    }
    let share = direction.dot(&(information * direction));
    if share.is_nan() || share >= OPEN {
        return false;
    }
    let step = prior.factor() * direction;
    let rise = |side: State<N>| alone.cost(&side) - here.cost;
    rise(x + step) > CURVED && rise(x - step) > CURVED
}
