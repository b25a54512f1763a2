use alloc::vec::Vec;

use foxhunt_core::{
    Correction, Estimator, EstimatorError, MeasurementModel, MotionModel, Observation,
};

use super::bank::Bank;
use crate::{Kalman, Transform};

/// The lightest component that is kept of several hypotheses.
pub(super) const NEGLIGIBLE: f64 = 1e-6;

/// Conditions a bank on an observation; where directions compete for a bearing, every component
/// goes on as one for each of them, with the weights that the evidence gives them.
pub(super) fn update_each<T, F, H, const N: usize, const M: usize>(
    bank: &mut Bank<Kalman<T, F, H, N, M>, N, M>,
    observation: &Observation<M>,
) -> Result<Correction, EstimatorError>
where
    T: Transform + Clone,
    F: MotionModel<N> + Clone,
    H: MeasurementModel<N, M> + Clone,
{
    if observation.bearing_modes().is_none() {
        return bank.update(observation);
    }
    let mut fused = Vec::new();
    let mut first = None;
    for (weight, one) in observation.hypotheses() {
        let mut branch = bank.clone();
        let correction = branch.update(&one)?;
        if let Correction::Fused { log_evidence, .. } = correction {
            fused.push((libm::log(weight) + log_evidence, branch));
        }
        // The first that some component fuses, or else the first.
        first = match first {
            Some(Correction::Fused { .. }) => first,
            Some(_) if !matches!(correction, Correction::Fused { .. }) => first,
            _ => Some(correction),
        };
    }
    let Some(mut correction) = first else { return Ok(Correction::Empty) };
    let highest = fused.iter().map(|(log, _)| *log).fold(f64::NEG_INFINITY, f64::max);
    if fused.is_empty() || highest <= f64::NEG_INFINITY {
        return Ok(correction);
    }
    let total: f64 = fused.iter().map(|(log, _)| libm::exp(log - highest)).sum();
    if let Correction::Fused { log_evidence, .. } = &mut correction {
        *log_evidence = highest + libm::log(total);
    }
    if let [(_, branch)] = &fused[..] {
        *bank = branch.clone();
        return Ok(correction);
    }
    let each = fused.iter().flat_map(|(log, branch)| {
        let share = libm::exp(log - highest) / total;
        branch.components().map(move |(weight, filter)| (share * weight, filter))
    });
    let each: Vec<_> = each.filter(|(w, _)| *w > NEGLIGIBLE).map(|(w, f)| (w, f.clone())).collect();
    bank.replace(each)?;
    Ok(correction)
}
