use foxhunt_core::parameter::{ParameterError, not_negative, positive, require};

use super::{AirspaceError, Void};

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
        /// Its East in metres.
        east: f64,
        /// Its North in metres.
        north: f64,
        /// Its Up in metres.
        up: f64,
    },
    /// A place that is not finite.
    #[error("drone {drone}'s place ({east}, {north}, {up}) m is not finite")]
    NotFinite {
        /// Index of the drone.
        drone: usize,
        /// Its East.
        east: f64,
        /// Its North.
        north: f64,
        /// Its Up.
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
