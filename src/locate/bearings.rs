use foxhunt_core::Observation;
use foxhunt_filters::{BearingLine, BearingWeights, Lenth1981};

use super::{LocateError, Located};

/// The place where the bearings meet, whatever their own σ: it follows from how they scatter.
pub(super) fn locate(
    observations: &[Observation<2>],
    weights: BearingWeights,
    estimator: &'static str,
) -> Result<Located, LocateError> {
    let lines: Vec<BearingLine> = observations
        .iter()
        .filter(|o| o.has(1))
        .map(|o| BearingLine { receiver: o.receiver().position.xy(), bearing: o.value()[1] })
        .collect();
    if lines.is_empty() {
        return Err(LocateError::NoBearings { estimator });
    }
    let fix = Lenth1981::maximum_likelihood()
        .with_weights(weights)
        .and_then(|lenth| lenth.locate(&lines))
        .map_err(|source| LocateError::Bearings { estimator, source })?;
    let rejected = fix.weights.iter().filter(|weight| **weight <= 0.0).count();
    Ok(Located { observations: lines.len() - rejected, rejected, ..Located::at(fix.position) })
}
