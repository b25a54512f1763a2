use core::fmt;

/// A vehicle's height above the ground below it, by its own devices.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct HeightAboveGround {
    /// The height in metres.
    pub metres: f64,
    /// The source of the height.
    pub source: HeightSource,
}

/// Source of a vehicle's own height above the ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum HeightSource {
    /// A distance sensor that looks down.
    Rangefinder,
    /// Its place above the terrain that its autopilot has: tiles, or an estimate.
    Terrain,
}

impl fmt::Display for HeightSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Rangefinder => "rangefinder",
            Self::Terrain => "the autopilot's terrain",
        })
    }
}
