//! Beliefs that are weighted sums of other estimators' beliefs: the components of all of them, with
//! their weights, their updates and their moments together.

mod bank;
mod first_bearing;
mod gaussian_sum;
mod imm;
mod reduction;
mod smoothing;

use alloc::{boxed::Box, vec::Vec};

use foxhunt_core::{
    Axis, Correction, Covariance, Estimate, Estimator, EstimatorError, MeasurementModel,
    MotionModel, Observation, Role, State,
    angle::Resultant,
    parameter::{not_negative, require},
};

use crate::{Gaussian, Innovation, Kalman, Transform, count::number};

pub use bank::Bank;
pub use first_bearing::{FirstBearing, RangeParameterised, polar_moments};
pub use gaussian_sum::GaussianSum;
pub use imm::{Imm, Transition};
pub(crate) use reduction::{Part, reduce};
pub use reduction::{split, split_standard_normal};

/// An estimator that can go on from another Gaussian belief: what mixing, merging and
/// splitting need.
pub trait Reinitialise<const N: usize> {
    /// Puts a Gaussian in place of the belief; models, gates and their records stay.
    ///
    /// # Errors
    ///
    /// An error when it is not finite or its covariance not symmetric and positive definite; the
    /// belief is then left as it was.
    fn reinitialise(&mut self, estimate: &Estimate<N>) -> Result<(), EstimatorError>;
}

/// Function that computes the innovation of an estimator, such as
/// [`Kalman::innovation`](crate::Kalman::innovation).
pub type InnovationOf<E, const M: usize> =
    fn(&E, &Observation<M>) -> Result<Innovation<M>, EstimatorError>;

/// One of a mixture. The logarithm of its weight is what is held: a product of many likelihoods
/// underflows.
#[derive(Clone, Debug)]
pub(crate) struct Component<E> {
    pub estimator: E,
    pub log_weight: f64,
}

impl<E> Component<E> {
    pub(crate) fn weight(&self) -> f64 {
        libm::exp(self.log_weight)
    }
}

/// Outcome of an observation in all components together.
enum Outcome {
    /// ln Σ wᵢ p(z | component i).
    Fused(f64),
    /// The gate of each component kept it out; the NIS and the limit of the heaviest.
    Rejected { nis: f64, limit: f64 },
}

impl Outcome {
    /// The correction by a mixture of which the observation had this NIS.
    fn with_nis(self, nis: Option<f64>) -> Correction {
        match self {
            Self::Fused(log_evidence) => {
                Correction::Fused { nis, log_evidence, effective_sample_size: None }
            }
            Self::Rejected { nis, limit } => Correction::Rejected { nis, limit },
        }
    }
}

impl<T, F, H, const N: usize, const M: usize> Reinitialise<N> for Kalman<T, F, H, N, M>
where
    T: Transform,
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
{
    fn reinitialise(&mut self, estimate: &Estimate<N>) -> Result<(), EstimatorError> {
        self.replace(Gaussian::new(*estimate, Role::Prior)?);
        Ok(())
    }
}

impl<E: ?Sized + Reinitialise<N>, const N: usize> Reinitialise<N> for &mut E {
    fn reinitialise(&mut self, estimate: &Estimate<N>) -> Result<(), EstimatorError> {
        (**self).reinitialise(estimate)
    }
}

impl<E: ?Sized + Reinitialise<N>, const N: usize> Reinitialise<N> for Box<E> {
    fn reinitialise(&mut self, estimate: &Estimate<N>) -> Result<(), EstimatorError> {
        (**self).reinitialise(estimate)
    }
}

/// Components with weights in proportion to these.
///
/// # Errors
///
/// [`EstimatorError`] if no component is given, a weight is negative or not finite, or all are
/// zero.
fn weighted<E>(
    parts: impl IntoIterator<Item = (f64, E)>,
) -> Result<Vec<Component<E>>, EstimatorError> {
    let mut components = Vec::new();
    for (weight, estimator) in parts {
        not_negative("component weight", weight)?;
        components.push(Component { estimator, log_weight: libm::log(weight) });
    }
    let proper = normalise(&mut components).is_some();
    let count = number(components.len());
    require(proper, "components", count, "at least one of a positive weight")?;
    Ok(components)
}

/// Makes the weights sum to 1; returns the logarithm of what they summed to. `None`, and nothing
/// done, where that is not finite.
pub(crate) fn normalise<E>(components: &mut [Component<E>]) -> Option<f64> {
    let best = components.iter().map(|c| c.log_weight).fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = components.iter().map(|c| libm::exp(c.log_weight - best)).sum();
    let log_total = best + libm::log(sum);
    if !log_total.is_finite() {
        return None;
    }
    components.iter_mut().for_each(|c| c.log_weight -= log_total);
    Some(log_total)
}

/// Returns the estimates of the components that have any weight.
fn estimates<E: Estimator<N, M>, const N: usize, const M: usize>(
    components: &[Component<E>],
) -> impl Iterator<Item = (f64, Estimate<N>)> + Clone {
    components
        .iter()
        .filter(|c| c.log_weight > f64::NEG_INFINITY)
        .map(|c| (c.weight(), c.estimator.estimate()))
}

/// The moments of the whole mixture.
pub(crate) fn belief_of<E: Estimator<N, M>, const N: usize, const M: usize>(
    components: &[Component<E>],
    axes: &[Axis; N],
) -> Result<Estimate<N>, EstimatorError> {
    combine(estimates(components), axes)
}

/// The NIS of the mixture, if each component of any weight has an innovation.
fn nis_of<E, const M: usize>(
    components: &[Component<E>],
    innovation: InnovationOf<E, M>,
    observation: &Observation<M>,
) -> Option<f64> {
    let innovations: Option<Vec<_>> = components
        .iter()
        .filter(|c| c.log_weight > f64::NEG_INFINITY)
        .map(|c| Some((c.weight(), innovation(&c.estimator, observation).ok()?)))
        .collect();
    nis_of_mixture(innovations?.into_iter(), observation)
}

/// Updates every component and weighs it by its evidence.
///
/// A component that fails keeps no weight. A component whose gate keeps the observation out keeps
/// its belief; a gate has no density, so the component is weighed by exp(−NIS / 2) over the
/// widest normaliser among the components that fused, that is 1 / √|2π S|. Where all keep it out
/// no weight changes.
///
/// # Errors
///
/// The last component's error where all fail; the components are then of no use.
fn correct<E: Estimator<N, M>, const N: usize, const M: usize>(
    components: &mut [Component<E>],
    observation: &Observation<M>,
) -> Result<Outcome, EstimatorError> {
    let mut failure = EstimatorError::NotFinite { role: Role::Expected };
    let mut normaliser = f64::INFINITY;
    let mut fused = false;
    let mut rejected: Vec<(usize, f64)> = Vec::new();
    let mut heaviest: Option<(f64, f64, f64)> = None;
    for (index, component) in components.iter_mut().enumerate() {
        let dead = component.log_weight <= f64::NEG_INFINITY;
        match component.estimator.update(observation) {
            Ok(Correction::Rejected { nis, limit }) => {
                rejected.push((index, nis));
                if heaviest.is_none_or(|(weight, ..)| component.log_weight > weight) {
                    heaviest = Some((component.log_weight, nis, limit));
                }
            }
            Ok(Correction::Fused { nis, log_evidence, .. }) if log_evidence.is_finite() => {
                component.log_weight += log_evidence;
                if !dead {
                    fused = true;
                    normaliser = normaliser.min(log_evidence + 0.5 * nis.unwrap_or(0.0));
                }
            }
            Ok(_) => component.log_weight = f64::NEG_INFINITY,
            Err(error) => {
                failure = error;
                component.log_weight = f64::NEG_INFINITY;
            }
        }
    }
    if let (false, Some((_, nis, limit))) = (fused, heaviest) {
        // Those that failed are out even so.
        return normalise(components).map(|_| Outcome::Rejected { nis, limit }).ok_or(failure);
    }
    for (index, nis) in rejected {
        components[index].log_weight += normaliser - 0.5 * nis;
    }
    normalise(components).map(Outcome::Fused).ok_or(failure)
}

/// The mean and covariance of a mixture whose weights sum to 1 (Bar-Shalom, Li & Kirubarajan
/// 2001, §1.4.16).
///
/// Deviations on an angle are taken about the direction of the means' resultant; where they
/// cancel, about the first mean.
///
/// # Errors
///
/// An error when what comes out is not finite.
fn combine<const N: usize>(
    parts: impl Iterator<Item = (f64, Estimate<N>)> + Clone,
    axes: &[Axis; N],
) -> Result<Estimate<N>, EstimatorError> {
    combine_each(&|visit| parts.clone().for_each(visit), axes)
}

/// Takes a part of a mixture: its weight and its moments.
type Visit<'a, const N: usize> = dyn FnMut((f64, Estimate<N>)) + 'a;

/// [`combine`], compiled once for all kinds of iterators: `each` shows all parts.
fn combine_each<const N: usize>(
    each: &dyn Fn(&mut Visit<'_, N>),
    axes: &[Axis; N],
) -> Result<Estimate<N>, EstimatorError> {
    let mut first = None;
    let mut resultants = [Resultant::default(); N];
    each(&mut |(weight, part)| {
        first.get_or_insert(part.mean);
        for (row, resultant) in resultants.iter_mut().enumerate() {
            if axes[row] == Axis::Angle {
                resultant.add(part.mean[row], weight);
            }
        }
    });
    let first = first.unwrap_or_else(State::zeros);
    let origin = State::from_fn(|row, _| match axes[row] {
        Axis::Linear => first[row],
        Axis::Angle => resultants[row].direction(1e-9).unwrap_or(first[row]),
    });
    let mut mean = origin;
    each(&mut |(weight, part)| mean += Axis::difference(axes, &part.mean, &origin) * weight);
    let mut covariance = Covariance::zeros();
    each(&mut |(weight, part)| {
        let deviation = Axis::difference(axes, &part.mean, &mean);
        covariance += (part.covariance + deviation * deviation.transpose()) * weight;
    });
    covariance.fill_upper_triangle_with_lower_triangle();
    if !mean.iter().chain(covariance.iter()).all(|v| v.is_finite()) {
        return Err(EstimatorError::NotFinite { role: Role::Posterior });
    }
    Ok(Estimate { mean: Axis::difference(axes, &mean, &State::zeros()), covariance })
}

/// yᵀ S⁻¹ y with the moments of a mixture's innovation, deviations taken about the
/// observation. `None` where they are not finite.
fn nis_of_mixture<const M: usize>(
    parts: impl Iterator<Item = (f64, Innovation<M>)> + Clone,
    observation: &Observation<M>,
) -> Option<f64> {
    // Each residual is the short way round from the observation, so they share an origin.
    let as_estimate = |(weight, innovation): (f64, Innovation<M>)| {
        (weight, Estimate { mean: innovation.residual, covariance: innovation.covariance })
    };
    let mixed = combine(parts.map(as_estimate), &[Axis::Linear; M]).ok()?;
    let residual = observation.strike(mixed.mean);
    let factor = mixed.covariance.cholesky()?;
    Some(residual.dot(&factor.solve(&residual))).filter(|nis| nis.is_finite())
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use nalgebra::{Matrix2, Vector2};

    use super::*;

    #[test]
    fn two_parts_across_the_cut() {
        let part = |x: f64, angle: f64| Estimate {
            mean: Vector2::new(x, angle),
            covariance: Matrix2::new(1.0, 0.1, 0.1, 0.01),
        };
        let parts = [(0.25, part(0.0, 3.1)), (0.75, part(4.0, -3.1))];
        let axes = [Axis::Linear, Axis::Angle];
        let mixed = combine(parts.into_iter(), &axes).expect("finite");
        // By hand: the angles lie 2π − 6.2 apart, the means at ¾ of the way.
        let apart = core::f64::consts::TAU - 6.2;
        assert_abs_diff_eq!(mixed.mean.x, 3.0, epsilon = 1e-14);
        assert_abs_diff_eq!(
            mixed.mean.y,
            foxhunt_core::angle::wrap(3.1 + 0.75 * apart),
            epsilon = 1e-14
        );
        let between = 0.25 * 0.75;
        let expected = Matrix2::new(
            1.0 + between * 16.0,
            0.1 + between * 4.0 * apart,
            0.1 + between * 4.0 * apart,
            0.01 + between * apart * apart,
        );
        assert!((mixed.covariance - expected).norm() < 1e-13, "{}", mixed.covariance);
    }
}
