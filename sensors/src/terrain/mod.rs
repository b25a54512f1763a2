//! Loss of level by the ground between two antennas, by knife edges (ITU-R P.526-15, §4.1 and
//! §4.5.1).

#[cfg(feature = "alloc")]
mod ground;

#[cfg(feature = "alloc")]
pub use ground::{HeightRaster, Hill, Hills};

use foxhunt_core::{
    Terrain,
    parameter::{ParameterError, positive},
};
use nalgebra::Vector3;

/// Nearer to each other than this nothing stands between two antennas, in metres.
const LEAST_M: f64 = 0.1;

/// Maximum distance for which a loss is computed, in metres.
const MOST_M: f64 = 1e7;

/// Maximum number of heights of a profile that are looked at.
const MOST_HEIGHTS: f64 = 512.0;

/// A terrain shared by worlds and models.
#[cfg(feature = "alloc")]
pub type SharedTerrain = alloc::sync::Arc<dyn Terrain + Send + Sync>;

/// The loss by diffraction over the terrain between two antennas, beyond that over level ground.
///
/// The profile is replaced by Bullington's equivalent knife edge, L = J(ν) + (1 − e^(−J/6))
/// (10 + 0.02 d) with d in km (ITU-R P.526-15, §4.5.1). The loss over level ground under the same
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

/// Bullington's equivalent knife edge of a profile: the tops of the ground as they are added, as
/// both antennas see them.
#[derive(Clone, Copy, Debug)]
struct Bullington {
    /// Heights of the antennas above the line that profile heights count from, in metres.
    antennas: [f64; 2],
    /// Between them, in metres.
    range: f64,
    /// The steepest slopes from either antenna to the ground.
    steepest: [f64; 2],
    /// The least square of the ground's depth below the line of sight over d₁ d₂.
    nearest: f64,
}

impl Bullington {
    fn new(antennas: [f64; 2], range: f64) -> Self {
        let steepest = [f64::NEG_INFINITY; 2];
        Self { antennas, range, steepest, nearest: f64::INFINITY }
    }

    /// Adds ground `height` metres high, `along` metres from the first antenna and not at either.
    fn add(&mut self, along: f64, height: f64) {
        let ([first, second], left) = (self.antennas, self.range - along);
        let sight = first + (second - first) * (along / self.range);
        let depth = sight - height;
        self.nearest = self.nearest.min(depth * depth / (along * left));
        let slopes = [(height - first) / along, (height - second) / left];
        for (steepest, slope) in self.steepest.iter_mut().zip(slopes) {
            *steepest = steepest.max(slope);
        }
    }

    /// The parameter ν of the equivalent edge, where the steepest lines of sight from both
    /// antennas meet; of the ground nearest to the line of sight where none is above it (ITU-R
    /// P.526-15, §4.5.1). Minus infinity without ground.
    fn parameter(&self, wavelength: f64) -> f64 {
        let Self { antennas: [first, second], range, steepest: [ahead, back], nearest } = *self;
        let sight = (second - first) / range;
        if ahead <= sight {
            return -libm::sqrt(nearest * 2.0 * range / wavelength);
        }
        let at = (second - first + back * range) / (ahead + back);
        // What rounding leaves of an edge right at an antenna.
        let at = at.clamp(1e-9 * range, (1.0 - 1e-9) * range);
        fresnel_parameter((ahead - sight) * at, [at, range - at], wavelength)
    }
}

/// The Fresnel-Kirchhoff parameter ν = h √(2/λ · (1/d₁ + 1/d₂)) of an edge (ITU-R
/// P.526-15, §4.1): h is its height above the straight line between the antennas, negative below,
/// d₁ and d₂ are its distances from them, λ is the wavelength, all in metres and but for h
/// above 0.
#[must_use]
pub fn fresnel_parameter(height: f64, [d1, d2]: [f64; 2], wavelength: f64) -> f64 {
    height * libm::sqrt(2.0 / wavelength * (1.0 / d1 + 1.0 / d2))
}

/// The loss in dB behind a knife edge of the Fresnel-Kirchhoff parameter ν,
///
/// J(ν) = 6.9 + 20 log₁₀(√((ν − 0.1)² + 1) + ν − 0.1),
///
/// and none up to ν = −0.78 (ITU-R P.526-15, §4.1): 6 dB where the edge touches the line of
/// sight.
///
/// ```
/// use foxhunt_sensors::knife_edge_loss_db;
/// assert!((knife_edge_loss_db(0.0) - 6.03).abs() < 0.01);
/// assert!((knife_edge_loss_db(2.4) - 20.54).abs() < 0.01);
/// ```
#[must_use]
pub fn knife_edge_loss_db(parameter: f64) -> f64 {
    if parameter <= -0.78 {
        return 0.0;
    }
    let x = parameter - 0.1;
    // At −0.78 the formula is 3·10⁻³ dB.
    6.9 + 20.0 * libm::log10(libm::hypot(x, 1.0) + x)
}

/// The loss in dB of a whole path of `range` metres whose single equivalent edge has the parameter
/// ν: J + (1 − e^(−J/6)) (10 + 0.02 d), d in km (ITU-R P.526-15, §4.5.1).
fn path_loss_db(parameter: f64, range: f64) -> f64 {
    let edge = knife_edge_loss_db(parameter);
    edge + (1.0 - libm::exp(-edge / 6.0)) * (10.0 + 0.02e-3 * range)
}

/// The parameter ν of level ground between two antennas so high above it: that of the place at
/// which it takes most, −2 √(2 h₁ h₂ / (λ d)).
fn level_ground(antennas: [f64; 2], range: f64, wavelength: f64) -> f64 {
    -2.0 * libm::sqrt(2.0 * antennas[0] * antennas[1] / (wavelength * range))
}
