use foxhunt_core::{Pose, Reception};
use foxhunt_filters::{Intercept, ShadowingGrid, ShadowingGridConfig, Slope};
use foxhunt_sensors::{LogDistance, Propagation};
use nalgebra::Vector2;

use super::{LocateConfig, LocateError, Located, Locator, Power, located::levels};

/// All levels at once on a grid, with shadowing that is correlated along the flight
/// (`filters::ShadowingGrid`): P₀ and γ are the intercept and the slope over −10 log₁₀ of
/// the range.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CorrelatedShadowing;

impl Locator for CorrelatedShadowing {
    fn locate(
        &self,
        receptions: &[Reception],
        config: &LocateConfig,
    ) -> Result<Located, LocateError> {
        let levels = levels(receptions)?;
        let (intercept, slope) = match config.power {
            Power::Free => (Intercept::Flat, ShadowingGridConfig::default().slope),
            Power::Known { reference_dbm, exponent } => {
                (Intercept::Known(reference_dbm), Slope::Known(exponent))
            }
        };
        let grid = ShadowingGrid::new(ShadowingGridConfig {
            intercept,
            slope,
            margin_m: config.margin_m,
            ..ShadowingGridConfig::default()
        })?;
        let unit = LogDistance::new(0.0, 1.0)?;
        let up = config.target_up_m;
        let fix = grid.locate(&levels, |cell: &Vector2<f64>, receiver: &Pose| {
            unit.rss_dbm((cell.push(up) - receiver.position).norm())
        })?;
        Ok(Located {
            observations: levels.len(),
            border_mass: Some(fix.border_mass),
            ..Located::at(fix.position)
        })
    }
}
