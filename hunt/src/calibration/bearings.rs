use foxhunt_core::BearingExtractor;
use foxhunt_sensors::{BearingOffset, Calibrated, ParameterError};
use serde::{Deserialize, Serialize};

/// Error of bearings, measured minus true, over the heading h of the nose, in degrees
/// counter-clockwise: offset + sin · sin h + cos · cos h with h counter-clockwise from East; and
/// the correction of their σ, σ² → (scale · σ)² + floor².
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BearingCalibration {
    /// The constant: boresight and yaw together.
    pub offset_deg_ccw: f64,
    /// Coefficient of the sine of the heading, in degrees.
    pub sin_heading_deg: f64,
    /// Coefficient of its cosine, in degrees.
    pub cos_heading_deg: f64,
    /// Factor of σ.
    pub sigma_scale: f64,
    /// Floor that is added to σ in squares, in degrees.
    pub sigma_floor_deg: f64,
    /// The share of bearings that have nothing to do with the direction, 0 to 0.5: estimators that
    /// weigh competing directions weigh any direction with it, others take the moments of all.
    #[serde(skip_serializing_if = "is_zero")]
    pub outlier_probability: f64,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it so")]
fn is_zero(number: &f64) -> bool {
    number.abs() <= 0.0
}

impl Default for BearingCalibration {
    /// No offset; σ as it is; no outliers.
    fn default() -> Self {
        Self {
            offset_deg_ccw: 0.0,
            sin_heading_deg: 0.0,
            cos_heading_deg: 0.0,
            sigma_scale: 1.0,
            sigma_floor_deg: 0.0,
            outlier_probability: 0.0,
        }
    }
}

impl BearingCalibration {
    /// The offset in radians.
    #[must_use]
    pub fn offset(&self) -> BearingOffset {
        BearingOffset {
            constant: self.offset_deg_ccw.to_radians(),
            sin_heading: self.sin_heading_deg.to_radians(),
            cos_heading: self.cos_heading_deg.to_radians(),
        }
    }

    /// Returns the corrected value of a σ in radians.
    #[must_use]
    pub fn sigma(&self, sigma: f64) -> f64 {
        libm::hypot(self.sigma_scale * sigma, self.sigma_floor_deg.to_radians())
    }

    /// Corrects the bearings of an extractor by this calibration.
    ///
    /// # Errors
    ///
    /// Names the number that is out of its range.
    pub fn wrap<X: BearingExtractor>(&self, extractor: X) -> Result<Calibrated<X>, ParameterError> {
        Calibrated::new(extractor)
            .with_offset(self.offset())?
            .with_sigma(self.sigma_scale, self.sigma_floor_deg.to_radians())?
            .with_outliers(self.outlier_probability)
    }
}
