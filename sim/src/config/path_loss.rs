//! The laws by which power falls with range.

use foxhunt_sensors::{LogDistance, ParameterError, Polarisation, TwoRay};
use serde::{Deserialize, Serialize};

/// The law by which power falls with range.
///
/// In a file `{ reference_dbm = -29.06, exponent = 2.765 }`, `{ law = "friis", power_dbm = 20.0 }`
/// or `{ law = "two-ray", power_dbm = 20.0 }`. The carrier is the channel's. What a law does not
/// know is refused.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Fields", into = "Fields")]
#[non_exhaustive]
pub enum PathLossConfig {
    /// [`LogDistance`].
    LogDistance(LogDistance),
    /// [`Friis`](foxhunt_sensors::Friis).
    Friis {
        /// The power sent and both antennas' gains together, in dBm; the receiver's is its mean
        /// over a turn.
        power_dbm: f64,
    },
    /// [`TwoRay`] over the ground at Up = 0.
    TwoRay(TwoRayConfig),
}

/// The settings of [`TwoRay`] in a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoRayConfig {
    /// The power sent and both antennas' gains together, in dBm; the receiver's is its mean over a
    /// turn.
    pub power_dbm: f64,
    /// The ground's relative permittivity.
    pub permittivity: f64,
    /// The polarisation of the waves.
    pub polarisation: Polarisation,
    /// An antenna of a beacon or drone that lies lower is at least at this height, in metres.
    pub least_height_m: f64,
}

impl TwoRayConfig {
    /// Ground neither wet nor dry, upright antennas, at least 0.1 m high.
    #[must_use]
    pub fn new(power_dbm: f64) -> Self {
        Self {
            power_dbm,
            permittivity: TwoRay::MEDIUM_GROUND,
            polarisation: Polarisation::Vertical,
            least_height_m: 0.1,
        }
    }

    /// The law between two places at these heights in metres.
    pub(crate) fn law(&self, wavelength: f64, heights: [f64; 2]) -> Result<TwoRay, ParameterError> {
        let [from, to] = heights.map(|height| height.max(self.least_height_m));
        TwoRay::new(self.power_dbm, wavelength, from, to)?
            .with_ground(self.permittivity, self.polarisation)
    }
}

impl From<LogDistance> for PathLossConfig {
    fn from(law: LogDistance) -> Self {
        Self::LogDistance(law)
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Law {
    #[default]
    LogDistance,
    Friis,
    TwoRay,
}

/// The fields as they stand in a file, of all laws together.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Fields {
    #[serde(skip_serializing_if = "Option::is_none")]
    law: Option<Law>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reference_dbm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    exponent: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    power_dbm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    permittivity: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    polarisation: Option<Polarisation>,
    #[serde(skip_serializing_if = "Option::is_none")]
    least_height_m: Option<f64>,
}

/// The reason why fields make no law.
#[derive(Debug, thiserror::Error)]
enum FieldsError {
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    #[error("path_loss: {field} is missing for the law {law}")]
    Missing { field: &'static str, law: &'static str },
    #[error("path_loss: the law {law} does not use {field}")]
    Unused { field: &'static str, law: &'static str },
}

impl Law {
    fn name(self) -> &'static str {
        match self {
            Self::LogDistance => "log-distance",
            Self::Friis => "friis",
            Self::TwoRay => "two-ray",
        }
    }

    fn uses(self) -> &'static [&'static str] {
        match self {
            Self::LogDistance => &["reference_dbm", "exponent"],
            Self::Friis => &["power_dbm"],
            Self::TwoRay => &["power_dbm", "permittivity", "polarisation", "least_height_m"],
        }
    }
}

impl TryFrom<Fields> for PathLossConfig {
    type Error = FieldsError;

    fn try_from(fields: Fields) -> Result<Self, FieldsError> {
        let law = fields.law.unwrap_or_default();
        for (field, given) in [
            ("reference_dbm", fields.reference_dbm.is_some()),
            ("exponent", fields.exponent.is_some()),
            ("power_dbm", fields.power_dbm.is_some()),
            ("permittivity", fields.permittivity.is_some()),
            ("polarisation", fields.polarisation.is_some()),
            ("least_height_m", fields.least_height_m.is_some()),
        ] {
            if given && !law.uses().contains(&field) {
                return Err(FieldsError::Unused { field, law: law.name() });
            }
        }
        let needed = |field: &'static str, value: Option<f64>| {
            value.ok_or(FieldsError::Missing { field, law: law.name() })
        };
        Ok(match law {
            Law::LogDistance => Self::LogDistance(LogDistance::new(
                needed("reference_dbm", fields.reference_dbm)?,
                needed("exponent", fields.exponent)?,
            )?),
            Law::Friis => Self::Friis { power_dbm: needed("power_dbm", fields.power_dbm)? },
            Law::TwoRay => {
                let usual = TwoRayConfig::new(needed("power_dbm", fields.power_dbm)?);
                Self::TwoRay(TwoRayConfig {
                    permittivity: fields.permittivity.unwrap_or(usual.permittivity),
                    polarisation: fields.polarisation.unwrap_or(usual.polarisation),
                    least_height_m: fields.least_height_m.unwrap_or(usual.least_height_m),
                    ..usual
                })
            }
        })
    }
}

impl From<PathLossConfig> for Fields {
    fn from(config: PathLossConfig) -> Self {
        match config {
            PathLossConfig::LogDistance(law) => Self {
                reference_dbm: Some(law.reference_dbm()),
                exponent: Some(law.exponent()),
                ..Self::default()
            },
            PathLossConfig::Friis { power_dbm } => {
                Self { law: Some(Law::Friis), power_dbm: Some(power_dbm), ..Self::default() }
            }
            PathLossConfig::TwoRay(config) => Self {
                law: Some(Law::TwoRay),
                power_dbm: Some(config.power_dbm),
                permittivity: Some(config.permittivity),
                polarisation: Some(config.polarisation),
                least_height_m: Some(config.least_height_m),
                ..Self::default()
            },
        }
    }
}
