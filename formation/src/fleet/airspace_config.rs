use std::vec::Vec;

use foxhunt_core::parameter::ParameterError;

/// Limits of the drones' flights. Lengths are metres in the local East-North-Up frame.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct AirspaceConfig {
    /// The corners of the polygon that must not be left, East and North, in either sense of
    /// rotation; it need not be convex. No fence where empty.
    pub fence_m: Vec<[f64; 2]>,
    /// Zones that must not be flown over.
    pub keep_out: Vec<KeepOut>,
    /// The lowest and the highest Up. Drones take off and land below it.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub altitude_m: Option<[f64; 2]>,
}

/// A zone over which no drone may fly, at any altitude.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(untagged, deny_unknown_fields))]
pub enum KeepOut {
    /// A disc.
    Disc {
        /// Its centre, East and North in metres.
        centre_m: [f64; 2],
        /// Its radius in metres.
        radius_m: f64,
    },
    /// A polygon, not necessarily convex.
    Polygon {
        /// Its corners, East and North in metres.
        corners_m: Vec<[f64; 2]>,
    },
}

/// Reason that there is no such airspace.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AirspaceError {
    /// A number that is not finite, or a length that has to be positive and is not.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// A polygon of fewer than three corners.
    #[error("{field} has {corners} corners and needs at least 3")]
    Corners {
        /// Name of the field.
        field: &'static str,
        /// Number of its corners.
        corners: usize,
    },
    /// A polygon whose sides cross or touch one another, or which has no area.
    #[error("{field}, which begins at ({east}, {north}) m, crosses itself or has no area")]
    NotSimple {
        /// Name of the field.
        field: &'static str,
        /// The East of its first corner.
        east: f64,
        /// The North of its first corner.
        north: f64,
    },
    /// The lowest altitude lies above the highest.
    #[error("altitude_m runs from {lowest} up to {highest} m")]
    Band {
        /// The first of the two.
        lowest: f64,
        /// The second.
        highest: f64,
    },
    /// The keep-outs, and the margin that is kept, leave nothing of what the fence holds.
    #[error("fence_m and keep_out leave no place that is {margin_m} m away from them")]
    NothingLeft {
        /// The margin that was to be kept.
        margin_m: f64,
    },
}
