use core::f64::consts::{FRAC_PI_2, FRAC_PI_6};

use foxhunt_core::parameter::{ParameterError, finite, require};

/// Altitude of a drone at a horizontal distance from where the target is believed to be.
///
/// Near and high spoils bearings: from the target, a drone stays below a limit of elevation, in
/// which the antenna's horizontal pattern still holds and the level still depends on the distance.
/// Far away it flies as high as its band allows.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct AltitudeRule {
    /// The largest elevation of the drone from the target, in radians, above 0 and below π/2.
    #[cfg_attr(feature = "serde", serde(rename = "elevation_limit_rad"))]
    pub elevation_limit: f64,
    /// The lowest altitude in metres, which is kept even where the limit is broken by it.
    pub least_m: f64,
    /// The highest altitude in metres.
    pub most_m: f64,
}

impl Default for AltitudeRule {
    /// A limit of 30°, and the band between the reference's two altitudes, 3 m and 4 m
    /// (Pritzl 2018, §5.2).
    fn default() -> Self {
        Self { elevation_limit: FRAC_PI_6, least_m: 3.0, most_m: 4.0 }
    }
}

impl AltitudeRule {
    /// Checks that the rule can be kept.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first field that is out of its range.
    pub fn check(&self) -> Result<(), ParameterError> {
        let limit = self.elevation_limit;
        let in_range = limit > 0.0 && limit < FRAC_PI_2;
        require(in_range, "elevation_limit_rad", limit, "above 0 and below π/2")?;
        finite("least_m", self.least_m)?;
        let banded = self.most_m.is_finite() && self.most_m >= self.least_m;
        require(banded, "most_m", self.most_m, "finite and not below least_m").map(|_| ())
    }

    /// The altitude in metres at a horizontal distance in metres: d tan ε in the band.
    #[must_use]
    pub fn altitude(&self, distance_m: f64) -> f64 {
        // Unlike `clamp` this cannot panic on a rule that was not checked.
        (distance_m * libm::tan(self.elevation_limit)).min(self.most_m).max(self.least_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_elevation_stays_below_the_limit_inside_the_band() {
        let rule = AltitudeRule { elevation_limit: 0.5, least_m: 2.0, most_m: 20.0 };
        assert_eq!(rule.check(), Ok(()));
        for distance in [4.0, 10.0, 30.0] {
            let elevation = libm::atan2(rule.altitude(distance), distance);
            assert!((elevation - 0.5).abs() < 1e-12, "{elevation} at {distance} m");
        }
        for (distance, altitude) in [(0.0, 2.0), (1.0, 2.0), (300.0, 20.0)] {
            assert!((rule.altitude(distance) - altitude).abs() < 1e-12);
        }
    }

    #[test]
    fn what_cannot_be_kept_is_named() {
        let rule = AltitudeRule::default();
        assert_eq!(rule.check(), Ok(()));
        for (bad, field) in [
            (AltitudeRule { elevation_limit: FRAC_PI_2, ..rule }, "elevation_limit_rad"),
            (AltitudeRule { elevation_limit: 0.0, ..rule }, "elevation_limit_rad"),
            (AltitudeRule { least_m: f64::NAN, ..rule }, "least_m"),
            (AltitudeRule { most_m: 2.9, ..rule }, "most_m"),
        ] {
            assert_eq!(bad.check().map_err(|error| error.name), Err(field));
        }
    }
}
