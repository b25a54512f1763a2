use foxhunt_core::{
    Terrain,
    parameter::{ParameterError, positive},
};
use nalgebra::Vector3;

use super::diffraction::{Bullington, level_ground, path_loss_db};

/// Nearer to each other than this nothing stands between two antennas, in metres.
const LEAST_M: f64 = 0.1;

/// Maximum distance for which a loss is computed, in metres.
const MOST_M: f64 = 1e7;

/// Maximum number of heights of a profile that are looked at.
const MOST_HEIGHTS: f64 = 512.0;

/// The loss by diffraction over the terrain between two antennas, beyond that over level ground.
///
/// The profile is replaced by Bullington's equivalent knife edge, L = J(ν) + (1 − e^(−J/6)) (10 +
/// 0.02 d) with d in km (ITU-R P.526-15, §4.5.1). The loss over level ground under the same
/// antennas is subtracted, as in the delta-Bullington method (§4.5.2): a law of propagation that
/// was measured over open ground has that loss already. So terrain that rises evenly from one
/// antenna to the other takes nothing, and no terrain adds to a level.
///
/// Heights of antennas are above the ground below them, never less than 0. Nothing is lost where
/// the ground below an antenna is not known; ground that is not known in between is left out. The
/// Earth's curvature is left out, which in the middle of 10 km is 1.5 m.
///
/// ```
/// use foxhunt_core::nalgebra::Vector3;
/// use foxhunt_sensors::{Hill, Hills, TerrainLoss};
/// # fn main() -> Result<(), foxhunt_sensors::ParameterError> {
/// let hill = Hill { east_m: 100.0, north_m: 0.0, height_m: 20.0, radius_m: 30.0 };
/// let loss = TerrainLoss::new(Hills::new(vec![hill])?, 0.123)?;
/// let drone = Vector3::new(0.0, 0.0, 4.0);
/// let behind = loss.loss_db(&drone, &Vector3::new(200.0, 0.0, 1.0));
/// let beside = loss.loss_db(&drone, &Vector3::new(0.0, 200.0, 1.0));
/// assert!(behind > 15.0 && beside < 0.1);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct TerrainLoss<G> {
    terrain: G,
    /// In metres.
    wavelength: f64,
    /// In metres.
    step: f64,
}

impl<G: Terrain> TerrainLoss<G> {
    /// The loss over a terrain at a wavelength in metres.
    ///
    /// # Errors
    ///
    /// If the wavelength or the terrain's step is not a positive number.
    pub fn new(terrain: G, wavelength: f64) -> Result<Self, ParameterError> {
        let step = positive("step_m", terrain.step_m())?;
        Ok(Self { terrain, wavelength: positive("wavelength", wavelength)?, step })
    }

    /// The terrain.
    #[must_use]
    pub fn terrain(&self) -> &G {
        &self.terrain
    }

    /// The loss in dB, 0 or more, between two antennas: East, North and the height above the ground
    /// below it, in metres.
    #[must_use]
    pub fn loss_db(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
        let start = from.xy();
        let way = to.xy() - from.xy();
        let range = way.norm();
        if !(LEAST_M..=MOST_M).contains(&range) {
            return 0.0;
        }
        let heights = (self.terrain.height(&start), self.terrain.height(&to.xy()));
        let (Some(foot), Some(other)) = heights else { return 0.0 };
        let antennas = [from.z.max(0.0), to.z.max(0.0)];
        let slope = (other - foot) / range;
        let mut edge = Bullington::new(antennas, range);
        // From the first antenna on, so that little changes when the second one moves a little: a
        // height that joins is at its foot.
        let step = self.step.max(range / MOST_HEIGHTS);
        let mut along = step;
        while along < range - 1e-3 * step {
            if let Some(height) = self.terrain.height(&(start + way * (along / range))) {
                edge.add(along, height - foot - slope * along);
            }
            along += step;
        }
        let level = level_ground(antennas, range, self.wavelength);
        let parameter = edge.parameter(self.wavelength);
        if parameter <= level {
            return 0.0;
        }
        path_loss_db(parameter, range) - path_loss_db(level, range)
    }
}
