use foxhunt_wire::geodesy::{Geodetic, LocalFrame};
use serde::{Deserialize, Serialize};

use super::FlyError;

/// The origin of the common frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Site {
    /// Latitude in degrees, WGS84, North positive.
    pub lat_deg: f64,
    /// Longitude in degrees, WGS84, East positive.
    pub lon_deg: f64,
    /// Height above the ellipsoid of the ground where the drones stand, in metres: what Up is
    /// counted from for drones with a GNSS receiver of their own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ground_alt_m: Option<f64>,
}

impl Site {
    /// The common East-North-Up frame.
    ///
    /// # Errors
    ///
    /// [`FlyError::Site`] when there is no such place.
    pub fn frame(&self) -> Result<LocalFrame, FlyError> {
        Ok(LocalFrame::new(Geodetic::new(
            self.lat_deg,
            self.lon_deg,
            self.ground_alt_m.unwrap_or(0.0),
        )?)?)
    }
}
