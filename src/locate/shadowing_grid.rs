use foxhunt_core::{Observation, Pose};
use foxhunt_filters::{Intercept, ShadowingGrid, ShadowingGridConfig, Slope};
use foxhunt_sensors::{LogDistance, Propagation};
use nalgebra::Vector2;

use super::{LocateConfig, LocateError, Located, Power, levels::levels};

/// All levels at once: P₀ and γ are the intercept and the slope over −10 log₁₀ of the range.
pub(super) fn locate(
    observations: &[Observation<2>],
    config: &LocateConfig,
) -> Result<Located, LocateError> {
    let levels = levels(observations, config.estimator.name())?;
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
