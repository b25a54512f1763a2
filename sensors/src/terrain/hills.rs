use alloc::vec::Vec;

use foxhunt_core::{
    Terrain,
    parameter::{ParameterError, finite, positive},
};
use nalgebra::Vector2;

/// A hill, or with a negative height a hollow: h e^(−(r / radius)²) at the distance r from its
/// top.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Hill {
    /// East of its top in metres.
    pub east_m: f64,
    /// North of its top in metres.
    pub north_m: f64,
    /// Height of its top above the plain, in metres.
    pub height_m: f64,
    /// Distance from its top at which it has fallen to 1/e of that, in metres.
    pub radius_m: f64,
}

/// Squared radii beyond which a hill is less than 10⁻¹⁵ of its height.
const NOTHING: f64 = 36.0;

/// A plain with hills on it, which add up.
#[derive(Clone, Debug, PartialEq)]
pub struct Hills {
    hills: Vec<Hill>,
    step_m: f64,
}

impl Hills {
    /// The plain with these hills; with none of them it is level.
    ///
    /// # Errors
    ///
    /// If a place or a height is not finite, or a radius not a positive number.
    pub fn new(hills: Vec<Hill>) -> Result<Self, ParameterError> {
        let mut least = f64::INFINITY;
        for hill in &hills {
            finite("east_m", hill.east_m)?;
            finite("north_m", hill.north_m)?;
            finite("height_m", hill.height_m)?;
            least = least.min(positive("radius_m", hill.radius_m)?);
        }
        // On an eighth of a radius off the top a hill is 0.4 % lower than there at most.
        let step_m = if hills.is_empty() { 100.0 } else { 0.125 * least };
        Ok(Self { hills, step_m })
    }
}

impl Terrain for Hills {
    /// The height above the plain; known everywhere.
    fn height(&self, place: &Vector2<f64>) -> Option<f64> {
        let height = |hill: &Hill| {
            let off = (place - Vector2::new(hill.east_m, hill.north_m)) / hill.radius_m;
            let square = off.norm_squared();
            if square < NOTHING { hill.height_m * libm::exp(-square) } else { 0.0 }
        };
        Some(self.hills.iter().map(height).sum())
    }

    /// An eighth of the smallest radius.
    fn step_m(&self) -> f64 {
        self.step_m
    }
}
