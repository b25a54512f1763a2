use foxhunt_core::parameter::{ParameterError, not_negative};
use foxhunt_formation::{Line, Offsets, Polygon, Scaled, Shape};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

/// A shape chosen at run time.
pub type BoxedShape = Box<dyn Shape + Send + Sync>;

/// Shape in which drones stand about the centre of their formation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum ShapeConfig {
    /// A regular polygon, the first drone to the East.
    Polygon {
        /// From the centre to each drone.
        circumradius_m: f64,
    },
    /// Side by side along East, the first drone at the eastern end.
    Line {
        /// From one drone to the next.
        spacing_m: f64,
    },
    /// Given places, in the order of the drones; more drones than places repeat them beside
    /// themselves.
    Offsets {
        /// East and North of the centre, for each drone.
        offsets_m: Vec<[f64; 2]>,
    },
    /// Another shape, made larger or smaller.
    Scaled {
        /// Factor of its size.
        scale: f64,
        /// Shape that is scaled.
        shape: Box<ShapeConfig>,
    },
}

impl ShapeConfig {
    /// Builds the shape.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names what is out of its range.
    pub fn build(&self) -> Result<BoxedShape, ParameterError> {
        Ok(match self {
            Self::Polygon { circumradius_m } => Box::new(polygon(*circumradius_m)?),
            Self::Line { spacing_m } => Box::new(Line::new(*spacing_m)?),
            Self::Offsets { offsets_m } => {
                let places: Vec<_> = offsets_m.iter().map(|p| Vector2::from(*p)).collect();
                Box::new(Offsets::new(places)?)
            }
            Self::Scaled { scale, shape } => Box::new(Scaled::new(shape.build()?, *scale)?),
        })
    }
}

/// A polygon whose circumradius is checked; 0 has all drones at one place, as one drone may be.
fn polygon(circumradius: f64) -> Result<Polygon, ParameterError> {
    Ok(Polygon { circumradius: not_negative("circumradius_m", circumradius)? })
}
