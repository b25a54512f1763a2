//! Grounds that need no map: hills on a plain, and a raster of another terrain's heights.

use alloc::vec::Vec;

use foxhunt_core::{
    Terrain,
    parameter::{ParameterError, finite, positive},
};
use nalgebra::Vector2;

/// Squared radii beyond which a hill is less than 10⁻¹⁵ of its height.
const NOTHING: f64 = 36.0;

/// Steps from the origin to a side at most.
const MOST_STEPS: f64 = 2000.0;

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

/// The heights of a terrain, read once at the places of a square raster about the origin: bilinear
/// between them, unknown beyond it and where the terrain does not know one of the four.
///
/// For terrains that take long to answer, as elevation models in degrees do.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightRaster {
    reach_m: f64,
    step_m: f64,
    /// Number of heights to a side.
    side: usize,
    /// Rows from the South, each from the West; NaN where unknown.
    heights: Vec<f32>,
}

impl HeightRaster {
    /// Reads a terrain up to `reach_m` East, North, West and South of the origin, at its own step,
    /// or where that would be more than 4001 to a side at a wider one.
    ///
    /// # Errors
    ///
    /// If the reach or the terrain's step is not a positive number.
    pub fn read(terrain: &impl Terrain, reach_m: f64) -> Result<Self, ParameterError> {
        positive("reach_m", reach_m)?;
        let steps = libm::ceil(reach_m / positive("step_m", terrain.step_m())?).min(MOST_STEPS);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "from 1 to 2000"
        )]
        let side = 2 * steps as usize + 1;
        let step_m = reach_m / steps;
        #[expect(clippy::cast_precision_loss, reason = "up to 4000")]
        let along = |index: usize| (index as f64 - steps) * step_m;
        #[expect(clippy::cast_possible_truncation, reason = "f32 has millimetres of heights")]
        let height = |row: usize, column: usize| {
            let height = terrain.height(&Vector2::new(along(column), along(row)));
            height.map_or(f32::NAN, |height| height as f32)
        };
        let heights = (0..side).flat_map(|row| (0..side).map(move |column| (row, column)));
        let heights = heights.map(|(row, column)| height(row, column)).collect();
        Ok(Self { reach_m, step_m, side, heights })
    }
}

impl Terrain for HeightRaster {
    fn height(&self, place: &Vector2<f64>) -> Option<f64> {
        let at = place.map(|along| (along + self.reach_m) / self.step_m);
        let whole = |at: f64| {
            let floor = libm::floor(at);
            #[expect(clippy::cast_precision_loss, reason = "up to 4000")]
            let last = (self.side - 1) as f64;
            (at >= 0.0 && at <= last).then(|| floor.min(last - 1.0))
        };
        let column = whole(at.x)?;
        let row = whole(at.y)?;
        let right = at.x - column;
        let up = at.y - row;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "from 0 to 3999"
        )]
        let first = row as usize * self.side + column as usize;
        let pair = |first: usize| {
            let pair = self.heights.get(first..first + 2)?;
            Some(f64::from(pair[0]) * (1.0 - right) + f64::from(pair[1]) * right)
        };
        let height = pair(first)? * (1.0 - up) + pair(first + self.side)? * up;
        height.is_finite().then_some(height)
    }

    fn step_m(&self) -> f64 {
        self.step_m
    }
}
