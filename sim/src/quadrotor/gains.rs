use foxhunt_core::parameter::{ParameterError, in_range, not_negative, positive};
use serde::{Deserialize, Serialize};

/// The controllers' gains: what acceleration, in m/s² or rad/s², an error of a metre or a radian
/// gives (`_p`), one that has lasted for a second (`_i`), and a speed of one per second (`_d`).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Gains {
    /// Altitude (eq. 9).
    pub altitude_p: f64,
    /// Altitude (eq. 9).
    pub altitude_d: f64,
    /// Heading (eq. 10).
    pub yaw_p: f64,
    /// Heading (eq. 10); a ramp needs it.
    pub yaw_i: f64,
    /// Heading (eq. 10).
    pub yaw_d: f64,
    /// Pitch and roll (eq. 19, 23).
    pub tilt_p: f64,
    /// Pitch and roll (eq. 19, 23).
    pub tilt_d: f64,
    /// Place (eq. 20, 24).
    pub place_p: f64,
    /// Place, against steady wind; 0 in the document.
    pub place_i: f64,
    /// Place (eq. 20, 24).
    pub place_d: f64,
}

impl Default for Gains {
    /// Altitude 16 and 8, yaw 48, 64 and 12 (three poles at −4 per second), tilt 225 and 30 (two
    /// at −15), place 5, 1.5 and 4: each critically damped or nearly so, and three to four times
    /// as fast as the loop around it.
    fn default() -> Self {
        Self {
            altitude_p: 16.0,
            altitude_d: 8.0,
            yaw_p: 48.0,
            yaw_i: 64.0,
            yaw_d: 12.0,
            tilt_p: 225.0,
            tilt_d: 30.0,
            place_p: 5.0,
            place_i: 1.5,
            place_d: 4.0,
        }
    }
}

impl Gains {
    /// Refuses what is not positive, or quicker than `most` per second.
    pub(super) fn check(&self, most: f64) -> Result<(), ParameterError> {
        for (field, value) in [
            ("altitude_p", self.altitude_p),
            ("altitude_d", self.altitude_d),
            ("yaw_p", self.yaw_p),
            ("yaw_d", self.yaw_d),
            ("tilt_p", self.tilt_p),
            ("tilt_d", self.tilt_d),
            ("place_p", self.place_p),
            ("place_d", self.place_d),
        ] {
            positive(field, value)?;
            // A gain on a place goes with the square of its rate.
            in_range(field, value, 0.0..=most * most, "below the square of half of rate_hz")?;
        }
        for (field, value) in
            [("altitude_d", self.altitude_d), ("yaw_d", self.yaw_d), ("tilt_d", self.tilt_d)]
        {
            in_range(field, value, 0.0..=most, "below half of rate_hz")?;
        }
        not_negative("yaw_i", self.yaw_i)?;
        not_negative("place_i", self.place_i)?;
        Ok(())
    }
}
