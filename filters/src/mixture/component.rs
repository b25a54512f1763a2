use alloc::vec::Vec;

use foxhunt_core::{
    Correction, Estimate, Estimator, EstimatorError, Observation, Role,
    parameter::{not_negative, require},
};

use super::moments;
use crate::{Innovation, count::number};

/// Function that computes the innovation of an estimator, such as
/// [`Kalman::innovation`](crate::Kalman::innovation).
pub type InnovationOf<E, const M: usize> =
    fn(&E, &Observation<M>) -> Result<Innovation<M>, EstimatorError>;

/// One of a mixture. The logarithm of its weight is what is held: a product of many likelihoods
/// underflows.
#[derive(Clone, Debug)]
pub(super) struct Component<E> {
    pub(super) estimator: E,
    pub(super) log_weight: f64,
}

impl<E> Component<E> {
    pub(super) fn weight(&self) -> f64 {
        libm::exp(self.log_weight)
    }
}

/// Components with weights in proportion to these.
///
/// # Errors
///
/// [`EstimatorError`] if no component is given, a weight is negative or not finite, or all are
/// zero.
pub(super) fn weighted<E>(
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
pub(super) fn normalise<E>(components: &mut [Component<E>]) -> Option<f64> {
    let best = components.iter().map(|c| c.log_weight).fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = components.iter().map(|c| libm::exp(c.log_weight - best)).sum();
    let log_total = best + libm::log(sum);
    if !log_total.is_finite() {
        return None;
    }
    components.iter_mut().for_each(|c| c.log_weight -= log_total);
    Some(log_total)
}

/// The estimates of those that have any weight.
pub(super) fn estimates<E: Estimator<N, M>, const N: usize, const M: usize>(
    components: &[Component<E>],
) -> impl Iterator<Item = (f64, Estimate<N>)> + Clone {
    components
        .iter()
        .filter(|c| c.log_weight > f64::NEG_INFINITY)
        .map(|c| (c.weight(), c.estimator.estimate()))
}

/// The NIS of the mixture, if each component of any weight has an innovation.
pub(super) fn nis<E, const M: usize>(
    components: &[Component<E>],
    innovation: InnovationOf<E, M>,
    observation: &Observation<M>,
) -> Option<f64> {
    let innovations: Option<Vec<_>> = components
        .iter()
        .filter(|c| c.log_weight > f64::NEG_INFINITY)
        .map(|c| Some((c.weight(), innovation(&c.estimator, observation).ok()?)))
        .collect();
    moments::nis(innovations?.into_iter(), observation)
}

/// Outcome of an observation in all components together.
pub(super) enum Outcome {
    /// ln Σ wᵢ p(z | component i).
    Fused(f64),
    /// The gate of each component kept it out; the NIS and the limit of the heaviest.
    Rejected { nis: f64, limit: f64 },
}

/// Updates every component and weighs it by its evidence.
///
/// One that fails keeps no weight. One whose gate keeps the observation out keeps its belief; a
/// gate has no density, so it is weighed by exp(−NIS / 2) over the widest normaliser among
/// those that fused, that is 1 / √|2π S|. Where all keep it out no weight changes.
///
/// # Errors
///
/// The last component's error where all fail; the components are then of no use.
pub(super) fn correct<E: Estimator<N, M>, const N: usize, const M: usize>(
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
