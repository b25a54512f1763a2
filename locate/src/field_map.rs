use foxhunt_core::Receptions;
use foxhunt_filters::{FieldMap, FieldMapConfig};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

use super::{LocateConfig, LocateError, Located, Locator, located::levels};

/// Place of the highest level on a map without any law of propagation (`filters::FieldMap`): a
/// baseline, that cannot know of a transmitter outside of the receivers' area.
#[derive(Clone, Copy, Debug)]
pub struct HighestOnMap;

impl Locator for HighestOnMap {
    fn locate(
        &self,
        receptions: &Receptions,
        config: &LocateConfig,
    ) -> Result<Located, LocateError> {
        let levels = levels(receptions)?;
        let map = FieldMapConfig { margin_m: config.margin_m, ..FieldMapConfig::default() };
        let mut generator = Xoshiro256PlusPlus::seed_from_u64(config.seed);
        let field = FieldMap::fit(&levels, &map)?;
        let maximum = field.maximum(&mut generator)?;
        Ok(Located {
            observations: levels.len(),
            border_mass: Some(maximum.map.border_mass()),
            ..Located::at(maximum.position)
        })
    }
}
