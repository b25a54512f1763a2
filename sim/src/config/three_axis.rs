use foxhunt_core::parameter::{FieldError, ParameterError, finite, positive, require};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// A transmitter that is received by the magnetic field near it, as an avalanche beacon at 457 kHz:
/// the moment of its coil.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DipoleConfig {
    /// Its strength, in milliampere square metres: 6.3 for the least that EN 300 718-1 demands of
    /// an avalanche beacon, 0.5 µA/m abeam 10 m off.
    pub moment_ma_m2: f64,
    /// Azimuth of the coil, in degrees counter-clockwise from East; 0 unless given.
    #[serde(default)]
    pub azimuth_deg_ccw_from_east: f64,
    /// Elevation of the coil above the horizon, in degrees; 0 unless given.
    #[serde(default)]
    pub elevation_deg: f64,
}

impl DipoleConfig {
    /// Its East, North and Up, in milliampere square metres.
    #[must_use]
    pub fn moment(&self) -> Vector3<f64> {
        let (sin, cos) = self.azimuth_deg_ccw_from_east.to_radians().sin_cos();
        let (up, level) = self.elevation_deg.to_radians().sin_cos();
        Vector3::new(cos * level, sin * level, up) * self.moment_ma_m2
    }

    pub(super) fn check(&self) -> Result<(), FieldError> {
        positive("moment_ma_m2", self.moment_ma_m2)?;
        finite("azimuth_deg_ccw_from_east", self.azimuth_deg_ccw_from_east)?;
        let elevation = self.elevation_deg;
        let level = (-90.0..=90.0).contains(&elevation);
        require(level, "elevation_deg", elevation, "from -90 to 90")?;
        Ok(())
    }
}

/// A receiver of three coils across each other, which measures the magnetic field up to its sign.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ThreeAxisConfig {
    /// σ of each axis, as a share of the field: its attitude, and how alike its coils are.
    pub share_sigma: f64,
    /// σ of each axis besides, in microamperes a metre: noise. Below three times this nothing is
    /// received.
    pub noise_ua_per_m: f64,
}

impl Default for ThreeAxisConfig {
    /// 5 % of the field, as of an attitude that is 2° off and coils that are alike to 4 %, and
    /// 0.5 nA/m, at which a beacon of the least strength is received some 45 m off.
    fn default() -> Self {
        Self { share_sigma: 0.05, noise_ua_per_m: 5e-4 }
    }
}

impl ThreeAxisConfig {
    /// Checks the ranges of all numbers.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first that cannot.
    pub fn check(&self) -> Result<(), ParameterError> {
        positive("share_sigma", self.share_sigma)?;
        positive("noise_ua_per_m", self.noise_ua_per_m)?;
        Ok(())
    }

    /// σ of each axis where the field is that strong.
    #[must_use]
    pub fn sigma(&self, field_ua_per_m: f64) -> f64 {
        (self.share_sigma * field_ua_per_m).hypot(self.noise_ua_per_m)
    }

    /// The weakest field that is received.
    pub(crate) fn floor(&self) -> f64 {
        3.0 * self.noise_ua_per_m
    }
}
