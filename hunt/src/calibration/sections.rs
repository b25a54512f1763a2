//! The sections of a calibration, and the correction of bearings.

use foxhunt_core::{
    BearingExtractor,
    parameter::{in_range, not_negative, require},
};
use foxhunt_sensors::{
    BearingOffset, Calibrated, LogDistance, ParameterError, PathLossFit, StationAntenna,
    StationFit, StationModel, StationPattern,
};
use foxhunt_wire::geodesy::{Geodetic, LocalFrame, compass_deg_to_radians, radians_to_compass_deg};
use serde::{Deserialize, Serialize};

use crate::locate::{CalibratedPower, Power};

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

/// The path loss, P = P₀ − 10 γ log₁₀ d.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PathLossSection {
    /// P₀: the mean power over a turn at one metre, in dBm.
    pub p0_dbm: f64,
    /// γ: the path-loss exponent.
    pub exponent: f64,
    /// The covariance of P₀ and γ, in dB² and dB.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<[[f64; 2]; 2]>,
    /// True if γ was held by a bound.
    #[serde(default)]
    pub at_bound: bool,
    /// The noise's standard deviation in dB.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_db: Option<f64>,
    /// Number of fitted points.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<usize>,
}

impl PathLossSection {
    /// Returns the knowledge of the power: the law, and its uncertainty where the file has it.
    #[must_use]
    pub fn power(&self) -> Power {
        let Self { p0_dbm: reference_dbm, exponent, .. } = *self;
        match (self.covariance, self.sigma_db) {
            (Some(covariance), Some(sigma_db)) => Power::Calibrated(CalibratedPower {
                reference_dbm,
                exponent,
                covariance,
                sigma_db,
                points: self.points.unwrap_or(LEAST_POINTS),
            }),
            _ => Power::Known { reference_dbm, exponent },
        }
    }

    /// Names the number that is out of its range.
    pub(super) fn check(&self) -> Result<(), ParameterError> {
        LogDistance::new(self.p0_dbm, self.exponent)?;
        if let Some(sigma_db) = self.sigma_db {
            not_negative("sigma_db", sigma_db)?;
        }
        if let Some([[level, shared], [also_shared, slope]]) = self.covariance {
            require(self.sigma_db.is_some(), "sigma_db", f64::NAN, "given beside a covariance")?;
            not_negative("the variance of P₀", level)?;
            not_negative("the variance of γ", slope)?;
            let most = (level * slope).sqrt();
            in_range("the covariance of P₀ and γ", shared, -most..=most, "within their σ")?;
            let symmetric = (shared - also_shared).abs() <= 1e-9 * most;
            let name = "the lower covariance of P₀ and γ";
            require(symmetric, name, also_shared, "equal to the upper one")?;
        }
        Ok(())
    }
}

impl From<&PathLossFit> for PathLossSection {
    fn from(fit: &PathLossFit) -> Self {
        let c = &fit.covariance;
        Self {
            p0_dbm: fit.reference_dbm,
            exponent: fit.exponent,
            covariance: Some([[c[(0, 0)], c[(0, 1)]], [c[(1, 0)], c[(1, 1)]]]),
            at_bound: fit.at_bound,
            sigma_db: Some(fit.sigma_db),
            points: Some(fit.points),
        }
    }
}

/// Number of points of a calibration that does not state it: the fewest that a law is fitted to.
const LEAST_POINTS: usize = 3;

/// Correction of bearings, and its uncertainty.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BearingSection {
    /// Source of the bearings: the extractor's name, or `recorded` for ready-made ones. Another
    /// extractor has another σ.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub extractor: Option<String>,
    /// Number of fitted bearings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bearings: Option<usize>,
    /// Correction of the bearings.
    pub correction: BearingCalibration,
    /// Half the 95 % intervals of offset, sine and cosine, in degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_intervals_deg: Option<[f64; 3]>,
    /// The 95 % interval of the σ's scale.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_scale_interval: Option<[f64; 2]>,
    /// The 95 % interval of the σ's floor, in degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_floor_interval_deg: Option<[f64; 2]>,
}

/// Quantile of the normal distribution that half a 95 % interval is in σ.
const HALF_95: f64 = 1.96;

/// Numbers that are fitted to bearings: offset, scale and floor of σ.
const FITTED: f64 = 3.0;

impl BearingSection {
    /// Returns the correction with σ widened for a new bearing: scale and floor by √(ν / (ν
    /// − 2)) with ν = n − 3, the floor also by the σ of the offset.
    #[must_use]
    pub fn predictive(&self) -> BearingCalibration {
        let [offset, sine, cosine] = self.half_intervals_deg.unwrap_or_default();
        // The mean square over all headings.
        let of_offset = (offset * offset + 0.5 * (sine * sine + cosine * cosine)).sqrt() / HALF_95;
        let widening = self.bearings.map_or(1.0, |bearings| {
            let count = u32::try_from(bearings).map_or(f64::INFINITY, f64::from);
            let freedom = (count - FITTED).max(2.5);
            if freedom.is_finite() { (freedom / (freedom - 2.0)).sqrt() } else { 1.0 }
        });
        BearingCalibration {
            sigma_scale: self.correction.sigma_scale * widening,
            sigma_floor_deg: libm::hypot(self.correction.sigma_floor_deg * widening, of_offset),
            ..self.correction
        }
    }
}

/// A station of fixed antennas. Boresights belong to the hardware, so a station is known by its
/// name, its place or both.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StationSection {
    /// Name in recordings; any name where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Place of the station; anywhere where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<StationPlace>,
    /// The half-power beamwidth of each antenna.
    pub beamwidth_deg: f64,
    /// Attenuation of each antenna from behind.
    pub front_to_back_db: f64,
    /// The scale of what the pattern does not explain.
    pub residual_db: f64,
    /// The power at which half the bursts are received; not known where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor_dbm: Option<f64>,
    /// Width in dB over which the probability of reception rises.
    #[serde(default = "one_db")]
    pub floor_width_db: f64,
    /// The antennas.
    pub antennas: Vec<StationAntennaSection>,
}

/// Place of a station, in degrees (WGS84).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StationPlace {
    /// Latitude of the station.
    pub lat_deg: f64,
    /// Longitude of the station.
    pub lon_deg: f64,
}

/// Distance within which a station is still the same one, in metres: GNSS receivers err by less,
/// and two stations are farther apart.
const SAME_PLACE_M: f64 = 100.0;

impl StationPlace {
    fn is_near(self, other: StationPlace) -> bool {
        let geodetic = |place: StationPlace| Geodetic {
            lat_deg: place.lat_deg,
            lon_deg: place.lon_deg,
            alt_m: 0.0,
        };
        let frame = LocalFrame::new(geodetic(self));
        frame.is_ok_and(|frame| frame.to_local(&geodetic(other)).norm() <= SAME_PLACE_M)
    }
}

fn one_db() -> f64 {
    1.0
}

/// One of a station's antennas.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StationAntennaSection {
    /// Boresight of the antenna in recordings, by which it is identified.
    pub recorded_deg_compass: f64,
    /// True boresight of the antenna.
    pub boresight_deg_compass: f64,
    /// Half the 95 % interval of the true boresight, for the reader.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_interval_deg: Option<f64>,
    /// Standard deviation of the boresight, which bearings take into account.
    #[serde(default)]
    pub boresight_sigma_deg: f64,
    /// Gain over the other antennas.
    #[serde(default)]
    pub gain_db: f64,
    /// Standard deviation of the gain, which bearings take into account.
    #[serde(default)]
    pub gain_sigma_db: f64,
    /// Effect of the site on it: the coefficients of cos θ, sin θ, cos 2θ, … in dB, θ
    /// counter-clockwise from East.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub site_db: Vec<f64>,
}

impl StationSection {
    /// Returns true if it is the station of this name at this place, as far as it names them.
    #[must_use]
    pub fn is_of(&self, name: &str, place: Option<StationPlace>) -> bool {
        self.name.as_deref().is_none_or(|own| own == name)
            && self.place.is_none_or(|own| place.is_some_and(|place| own.is_near(place)))
    }

    /// The pattern.
    ///
    /// # Errors
    ///
    /// Names the number that is out of its range.
    pub fn build(&self) -> Result<StationPattern, ParameterError> {
        if let Some(StationPlace { lat_deg, lon_deg }) = self.place {
            in_range("place.lat_deg", lat_deg, -90.0..=90.0, "between -90 and 90")?;
            in_range("place.lon_deg", lon_deg, -180.0..=360.0, "between -180 and 360")?;
        }
        let antenna = |own: &StationAntennaSection| StationAntenna {
            recorded_boresight: compass_deg_to_radians(own.recorded_deg_compass),
            boresight: compass_deg_to_radians(own.boresight_deg_compass),
            boresight_sigma: own.boresight_sigma_deg.to_radians(),
            gain_db: own.gain_db,
            gain_sigma_db: own.gain_sigma_db,
            site_db: own.site_db.clone(),
        };
        let antennas = self.antennas.iter().map(antenna).collect();
        let beamwidth = self.beamwidth_deg.to_radians();
        let pattern = StationPattern::new(antennas, beamwidth, self.front_to_back_db)?
            .with_residual_db(self.residual_db)?;
        match self.floor_dbm {
            Some(floor) => pattern.with_floor(floor, self.floor_width_db),
            None => Ok(pattern),
        }
    }
}

impl From<&StationFit> for StationSection {
    fn from(fit: &StationFit) -> Self {
        let mut section = Self::from(&fit.pattern);
        for (antenna, half) in section.antennas.iter_mut().zip(&fit.boresight_half_intervals) {
            antenna.half_interval_deg = Some(half.to_degrees()).filter(|half| half.is_finite());
        }
        section
    }
}

impl From<&StationPattern> for StationSection {
    fn from(pattern: &StationPattern) -> Self {
        let antenna = |own: &StationAntenna| StationAntennaSection {
            recorded_deg_compass: radians_to_compass_deg(own.recorded_boresight),
            boresight_deg_compass: radians_to_compass_deg(own.boresight),
            half_interval_deg: None,
            boresight_sigma_deg: own.boresight_sigma.to_degrees(),
            gain_db: own.gain_db,
            gain_sigma_db: own.gain_sigma_db,
            site_db: own.site_db.clone(),
        };
        Self {
            name: None,
            place: None,
            beamwidth_deg: pattern.beamwidth().to_degrees(),
            front_to_back_db: pattern.front_to_back_db(),
            residual_db: pattern.residual_db(),
            floor_dbm: pattern.floor().map(|[dbm, _]| dbm),
            floor_width_db: pattern.floor().map_or(one_db(), |[_, width]| width),
            antennas: pattern.antennas().iter().map(antenna).collect(),
        }
    }
}

/// Common pattern of stations of one make, for stations that have no section of their own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StationModelSection {
    /// Number of stations that it was fitted to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stations: Option<usize>,
    /// The half-power beamwidth of each antenna.
    pub beamwidth_deg: f64,
    /// Attenuation of each antenna from behind.
    pub front_to_back_db: f64,
    /// The scale of what the pattern does not explain.
    pub residual_db: f64,
    /// The power at which half the bursts are received; not known where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor_dbm: Option<f64>,
    /// Width in dB over which the probability of reception rises.
    #[serde(default = "one_db")]
    pub floor_width_db: f64,
    /// κ: standard deviation of the recorded boresights' errors.
    pub boresight_sigma_deg: f64,
    /// τ: standard deviation of the antennas' gains.
    pub gain_sigma_db: f64,
}

impl StationModelSection {
    /// The section of a station with antennas of these recorded boresights, in radians.
    ///
    /// # Errors
    ///
    /// Names the number that is out of its range.
    pub fn station(&self, recorded: &[f64]) -> Result<StationSection, ParameterError> {
        self.model().pattern(recorded).map(|pattern| StationSection::from(&pattern))
    }

    /// The model.
    #[must_use]
    pub fn model(&self) -> StationModel {
        StationModel {
            beamwidth: self.beamwidth_deg.to_radians(),
            front_to_back_db: self.front_to_back_db,
            residual_db: self.residual_db,
            floor: self.floor_dbm.map(|floor_dbm| [floor_dbm, self.floor_width_db]),
            boresight_sigma: self.boresight_sigma_deg.to_radians(),
            gain_sigma_db: self.gain_sigma_db,
        }
    }
}

impl From<&StationModel> for StationModelSection {
    fn from(model: &StationModel) -> Self {
        Self {
            stations: None,
            beamwidth_deg: model.beamwidth.to_degrees(),
            front_to_back_db: model.front_to_back_db,
            residual_db: model.residual_db,
            floor_dbm: model.floor.map(|[dbm, _]| dbm),
            floor_width_db: model.floor.map_or(one_db(), |[_, width]| width),
            boresight_sigma_deg: model.boresight_sigma.to_degrees(),
            gain_sigma_db: model.gain_sigma_db,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    /// A new bearing's error has the variance of the offset beside its own, and the fewer bearings
    /// were fitted the less its scale is known.
    #[test]
    fn new_bearings_are_less_certain_than_fitted_ones() {
        let correction = BearingCalibration { sigma_scale: 2.0, ..<_>::default() };
        let section = |bearings, half_intervals_deg| BearingSection {
            extractor: None,
            bearings,
            correction,
            half_intervals_deg,
            sigma_scale_interval: None,
            sigma_floor_interval_deg: None,
        };
        assert_eq!(section(None, None).predictive(), correction);
        let many = section(Some(1003), Some([19.6, 0.0, 0.0])).predictive();
        assert_abs_diff_eq!(many.sigma_scale, 2.0 * (1000.0_f64 / 998.0).sqrt(), epsilon = 1e-12);
        assert_abs_diff_eq!(many.sigma_floor_deg, 10.0, epsilon = 1e-12);
        let few = section(Some(7), Some([0.0, 19.6, 19.6])).predictive();
        assert_abs_diff_eq!(few.sigma_scale, 2.0 * 2.0_f64.sqrt(), epsilon = 1e-12);
        assert_abs_diff_eq!(few.sigma_floor_deg, 10.0, epsilon = 1e-12);
    }

    #[test]
    fn a_law_is_uncertain_where_the_file_says_so() {
        let text = "p0_dbm = -30.0\nexponent = 2.5\n";
        let read = |more: &str| -> PathLossSection {
            toml::from_str(&format!("{text}{more}")).expect("a section")
        };
        let known = Power::Known { reference_dbm: -30.0, exponent: 2.5 };
        assert_eq!(read("").power(), known);
        assert_eq!(read("sigma_db = 3.0").power(), known);
        let whole = read("sigma_db = 3.0\npoints = 20\ncovariance = [[4.0, 0.1], [0.1, 0.01]]");
        let Power::Calibrated(law) = whole.power() else { panic!("{whole:?}") };
        assert_eq!((law.points, law.covariance), (20, [[4.0, 0.1], [0.1, 0.01]]));
    }
}
