use core::f64::consts::FRAC_PI_2;

/// The elevation angle rule: near and high spoils bearings, because a level antenna sees a target
/// that lies steeply below in every direction alike.
///
/// The altitude is such that the elevation angle from the target on the ground to the drone is at
/// most the limit, as high as that allows, inside the band. Near the target the lower end of the
/// band wins over the limit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct AltitudeRule {
    /// The elevation angle that is not exceeded, in radians, in (0, π/2).
    pub elevation_limit: f64,
    /// The lowest altitude in metres.
    pub least_m: f64,
    /// The highest altitude in metres.
    pub most_m: f64,
}

impl Default for AltitudeRule {
    /// At most 35°, from 2 to 4 m.
    fn default() -> Self {
        Self { elevation_limit: 35.0_f64.to_radians(), least_m: 2.0, most_m: 4.0 }
    }
}

impl AltitudeRule {
    /// The altitude at a horizontal distance from the target, both in metres.
    #[must_use]
    pub fn altitude(&self, distance_m: f64) -> f64 {
        let allowed = distance_m * libm::tan(self.elevation_limit);
        // Not `clamp`, which panics on an inverted band.
        allowed.min(self.most_m).max(self.least_m)
    }

    /// The first field that is out of its range, and its value.
    ///
    /// # Errors
    ///
    /// The field's name and value.
    pub fn check(&self) -> Result<(), (&'static str, f64)> {
        let Self { elevation_limit, least_m, most_m } = *self;
        let checks = [
            (
                "elevation_limit",
                elevation_limit,
                elevation_limit > 0.0 && elevation_limit < FRAC_PI_2,
            ),
            ("least_m", least_m, least_m >= 0.0 && least_m.is_finite()),
            ("most_m", most_m, most_m >= least_m && most_m > 0.0 && most_m.is_finite()),
        ];
        match checks.into_iter().find(|(.., in_range)| !in_range) {
            Some((field, value, _)) => Err((field, value)),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_elevation_stays_below_the_limit() {
        let rule = AltitudeRule { elevation_limit: 0.5, least_m: 2.0, most_m: 30.0 };
        for distance in [4.0, 10.0, 40.0, 54.0] {
            let elevation = libm::atan2(rule.altitude(distance), distance);
            assert!((elevation - 0.5).abs() < 1e-12, "{distance}: {elevation}");
        }
        assert!((rule.altitude(500.0) - 30.0).abs() < 1e-12);
        assert!((rule.altitude(0.0) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_band_that_is_none_is_named() {
        assert_eq!(AltitudeRule::default().check(), Ok(()));
        let inverted = AltitudeRule { least_m: 5.0, ..AltitudeRule::default() };
        assert_eq!(inverted.check(), Err(("most_m", 4.0)));
        let steep = AltitudeRule { elevation_limit: 2.0, ..AltitudeRule::default() };
        assert_eq!(steep.check(), Err(("elevation_limit", 2.0)));
    }
}
