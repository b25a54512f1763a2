//! Limits of the drones' flights and the distances that they keep; and why these are refused.

use std::vec::Vec;

use foxhunt_core::parameter::{ParameterError, not_negative, positive, require};

use super::Void;

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
        /// Centre of the disc, East and North in metres.
        centre_m: [f64; 2],
        /// Radius of the disc in metres.
        radius_m: f64,
    },
    /// A polygon, not necessarily convex.
    Polygon {
        /// Corners of the polygon, East and North in metres.
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

/// Distances that drones keep from one another. Lengths are metres over ground.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct TrafficConfig {
    /// No two drones come nearer to each other than this, whatever their altitudes.
    pub separation_m: f64,
    /// Largest distance of a drone from its line: half of it for where it arrives, since it is at a
    /// place when it is within half of this, and half for how it strays from its straight flight,
    /// its GNSS's error included. Lines keep `separation_m + 2 tolerance_m` from one another, and
    /// `tolerance_m` from the fence and the keep-outs.
    pub tolerance_m: f64,
    /// Distance that a drone flies on along its line after it is ordered to stop or to turn.
    pub stopping_m: f64,
    /// Distance that drones keep from targets; not kept where absent.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub void: Option<Void>,
}

impl Default for TrafficConfig {
    /// 2 m of separation, 0.5 m of tolerance, 1 m to stop, no void.
    fn default() -> Self {
        Self { separation_m: 2.0, tolerance_m: 0.5, stopping_m: 1.0, void: None }
    }
}

impl TrafficConfig {
    pub(super) fn check(&self) -> Result<(), ParameterError> {
        positive("separation_m", self.separation_m)?;
        positive("tolerance_m", self.tolerance_m)?;
        not_negative("stopping_m", self.stopping_m)?;
        if let Some(Void { radius_m, probability }) = self.void {
            positive("void.radius_m", radius_m)?;
            let below_one = (0.0..1.0).contains(&probability);
            require(below_one, "void.probability", probability, "at least 0 and below 1")?;
        }
        Ok(())
    }

    /// Returns the distance that the lines of two drones keep from each other, and so their goals:
    /// the separation and twice the tolerance, in metres.
    #[must_use]
    pub fn keep_m(&self) -> f64 {
        self.separation_m + 2.0 * self.tolerance_m
    }
}

/// Reason that the traffic refuses something.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrafficError {
    /// A field of the configuration that is out of its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The airspace leaves no room for the tolerance.
    #[error(transparent)]
    Airspace(#[from] AirspaceError),
    /// Two drones begin nearer to each other than the separation.
    #[error(
        "drones {first} and {second} are {distance_m:.3} m apart; the separation is \
         {separation_m} m"
    )]
    TooNear {
        /// The one.
        first: usize,
        /// The other.
        second: usize,
        /// Distance between them over ground, in metres.
        distance_m: f64,
        /// Distance required, in metres.
        separation_m: f64,
    },
    /// A drone begins where it must not be.
    #[error("drone {drone} begins at ({east}, {north}, {up}) m, outside the airspace")]
    Outside {
        /// Index of the drone.
        drone: usize,
        /// East of the drone in metres.
        east: f64,
        /// North of the drone in metres.
        north: f64,
        /// Up of the drone in metres.
        up: f64,
    },
    /// A place that is not finite.
    #[error("drone {drone}'s place ({east}, {north}, {up}) m is not finite")]
    NotFinite {
        /// Index of the drone.
        drone: usize,
        /// East of the place in metres.
        east: f64,
        /// North of the place in metres.
        north: f64,
        /// Up of the place in metres.
        up: f64,
    },
    /// There is no such drone, or it was named twice.
    #[error("there is no drone {drone}, or it is named twice; there are {drones}, counted from 0")]
    Drone {
        /// The index that was named.
        drone: usize,
        /// Number of drones.
        drones: usize,
    },
    /// Not as many places as drones.
    #[error("there are {places} places for {drones} drones")]
    Places {
        /// Number of places.
        places: usize,
        /// Number of drones.
        drones: usize,
    },
}
