use foxhunt_core::Observation;
use foxhunt_filters::{FieldMap, FieldMapConfig};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

use super::{LocateConfig, LocateError, Located, levels::levels};

/// Where the level is highest on a map that knows of no law of propagation.
pub(super) fn locate(
    observations: &[Observation<2>],
    config: &LocateConfig,
) -> Result<Located, LocateError> {
    let levels = levels(observations, config.estimator.name())?;
    let map = FieldMapConfig { margin_m: config.margin_m, ..FieldMapConfig::default() };
    let mut generator = Xoshiro256PlusPlus::seed_from_u64(config.seed);
    let maximum = FieldMap::fit(&levels, &map)
        .and_then(|field| field.maximum(&mut generator))
        .map_err(LocateError::Field)?;
    Ok(Located {
        observations: levels.len(),
        border_mass: Some(maximum.map.border_mass()),
        ..Located::at(maximum.position)
    })
}
