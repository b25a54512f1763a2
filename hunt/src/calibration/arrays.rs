use foxhunt_core::parameter::{ParameterError, finite, not_negative, positive, require};
use foxhunt_sensors::{Deviation, DeviationFit, MOST_HARMONICS, SigmaFit};
use serde::{Deserialize, Serialize};

/// Error of the bearings of an array of antennas that does not turn: measured minus true in degrees
/// counter-clockwise, over the measured direction θ counter-clockwise from the array's nose,
/// offset + Σ sine · sin kθ + cosine · cos kθ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArraySection {
    /// The receiver's name, as recordings call it; any receiver where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Number of fitted bearings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bearings: Option<usize>,
    /// The constant.
    pub offset_deg_ccw: f64,
    /// Sine and cosine of each harmonic, the first first.
    pub harmonics_deg: Vec<[f64; 2]>,
    /// Rows of the covariance of the constant and all sines and cosines, in deg²; taken for exact
    /// where absent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub covariance_deg2: Vec<Vec<f64>>,
    /// σ of a measured bearing, for bearings without one of their own.
    pub sigma_deg: f64,
    /// Factor of the σ that bearings have of their own.
    #[serde(default = "one")]
    pub sigma_scale: f64,
    /// Floor that is added to that σ in squares.
    #[serde(default)]
    pub sigma_floor_deg: f64,
}

fn one() -> f64 {
    1.0
}

impl ArraySection {
    /// Takes a fitted deviation, and how the bearings' own σ compare with their errors, if they
    /// have any.
    #[must_use]
    pub fn new(name: Option<&str>, fit: &DeviationFit, sigma: Option<&SigmaFit>) -> Self {
        let square = 1_f64.to_degrees().powi(2);
        let deviation = &fit.deviation;
        let row = |row: &mut dyn Iterator<Item = f64>| row.map(|value| value * square).collect();
        Self {
            name: name.map(str::to_owned),
            bearings: Some(fit.points),
            offset_deg_ccw: deviation.constant().to_degrees(),
            harmonics_deg: deviation.harmonics().map(|own| own.map(f64::to_degrees)).collect(),
            covariance_deg2: deviation.covariance().map(|mut own| row(&mut own)).collect(),
            sigma_deg: fit.sigma.to_degrees(),
            sigma_scale: sigma.map_or(1.0, |fit| fit.scale),
            sigma_floor_deg: sigma.map_or(0.0, |fit| fit.floor.to_degrees()),
        }
    }

    /// Names the first number that is out of its range.
    ///
    /// # Errors
    ///
    /// The number's name and value, and the requirement.
    pub fn check(&self) -> Result<(), ParameterError> {
        finite("offset_deg_ccw", self.offset_deg_ccw)?;
        for value in self.harmonics_deg.iter().flatten() {
            finite("harmonics_deg", *value)?;
        }
        #[expect(clippy::cast_precision_loss, reason = "a few")]
        let pairs = self.harmonics_deg.len() as f64;
        let few = self.harmonics_deg.len() <= MOST_HARMONICS;
        require(few, "the number of pairs in harmonics_deg", pairs, "at most 8")?;
        positive("sigma_deg", self.sigma_deg)?;
        not_negative("sigma_scale", self.sigma_scale)?;
        not_negative("sigma_floor_deg", self.sigma_floor_deg)?;
        let sum = self.sigma_scale + self.sigma_floor_deg;
        positive("the sum of sigma_scale and sigma_floor_deg", sum)?;
        #[expect(clippy::cast_precision_loss, reason = "a few")]
        let rows = self.covariance_deg2.len() as f64;
        let covariance = "the symmetric covariance of the offset and of both numbers of each pair";
        require(self.deviation().is_some(), "covariance_deg2 in rows", rows, covariance).map(drop)
    }

    /// Returns the deviation; `None` where its harmonics or its covariance are out of their range,
    /// which [`check`](Self::check) names.
    #[must_use]
    pub fn deviation(&self) -> Option<Deviation> {
        let square = 1_f64.to_radians().powi(2);
        let radians = |own: &Vec<f64>| own.iter().map(|value| value * square).collect();
        let rows: Vec<Vec<f64>> = self.covariance_deg2.iter().map(radians).collect();
        let harmonics: Vec<[f64; 2]> =
            self.harmonics_deg.iter().map(|own| own.map(f64::to_radians)).collect();
        Deviation::new(self.offset_deg_ccw.to_radians(), &harmonics, &rows)
    }

    /// Returns σ in radians of a measured bearing, from its own σ if it has one.
    #[must_use]
    pub fn sigma(&self, own: Option<f64>) -> f64 {
        own.map_or(self.sigma_deg.to_radians(), |own| {
            libm::hypot(self.sigma_scale * own, self.sigma_floor_deg.to_radians())
        })
    }
}
