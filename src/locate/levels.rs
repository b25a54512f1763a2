use foxhunt_core::{Observation, Pose};

use super::LocateError;

/// The levels that were heard, each with its receiver, along the path.
pub(super) fn levels(
    observations: &[Observation<2>],
    estimator: &'static str,
) -> Result<Vec<(Pose, f64)>, LocateError> {
    let levels: Vec<_> =
        observations.iter().filter(|o| o.has(0)).map(|o| (*o.receiver(), o.value()[0])).collect();
    if levels.is_empty() { Err(LocateError::NoLevels { estimator }) } else { Ok(levels) }
}
