//! An antenna chosen at run time.

use std::{
    fs,
    path::{Path, PathBuf},
    string::{String, ToString},
    sync::{Arc, LazyLock},
    vec::Vec,
};

use foxhunt_core::parameter::ParameterError;

use super::{
    Antenna, Cardioid, Dipole, Isotropic, MsiFile, Patch, PatternFileError, PatternTable,
    PatternTable3d, PatternTableError, Yagi,
};

/// An antenna shared by the channel that receives through it and the extractors that know it.
pub type SharedAntenna = Arc<dyn Antenna + Send + Sync>;

/// A thousand worlds of a campaign share its 1440 rows of powers and logarithms.
static REFERENCE_PATCH: LazyLock<SharedAntenna> =
    LazyLock::new(|| Arc::new(PatternTable::reference_patch()));

/// Reason that there is no antenna.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AntennaError {
    /// A parameter is out of its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The rows of a table make no pattern.
    #[error(transparent)]
    Table(#[from] PatternTableError),
    /// A file cannot be read.
    #[error("{file}: {reason}")]
    Read {
        /// The file.
        file: String,
        /// The system's error.
        reason: String,
    },
    /// A file holds no antenna.
    #[error("{file}, {source}")]
    File {
        /// The file.
        file: String,
        /// The line and its fault.
        source: PatternFileError,
    },
    /// A file's extension belongs to no known format.
    #[error("{file} has the extension {extension:?}; antennas are read from msi, pln and csv")]
    Extension {
        /// The file.
        file: String,
        /// Extension of the file, in small letters.
        extension: String,
    },
}

/// An antenna chosen at run time.
///
/// In a file one of [`NAMES`](Self::NAMES), such as `"dipole"` or `"yagi"`, or a table:
/// `{ yagi = { elements = 5 } }`, `{ file = "panel.msi" }` or
/// `{ table = [{ angle_deg = 0.0, gain_db = 8.0 }, …] }`. The default is the reference patch.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum AntennaConfig {
    /// [`PatternTable::reference_patch`]: 70.1° half-power beamwidth, 17.0 dB front-to-back,
    /// figures of ours; gain over its maximum.
    #[default]
    ReferencePatch,
    /// [`Isotropic`].
    Isotropic,
    /// [`Dipole`].
    Dipole,
    /// [`Cardioid`].
    Cardioid(CardioidConfig),
    /// [`Patch`].
    Patch(PatchConfig),
    /// [`Yagi`].
    Yagi(YagiConfig),
    /// Rows of increasing angle that span less than a turn; the gain is the same at every
    /// elevation.
    Table(Vec<GainRow>),
    /// A file, read by its extension: `.msi` or `.pln` ([`MsiFile`]), or `.csv` with a table over
    /// the angle ([`PatternTable::from_csv`]) or over both angles ([`PatternTable3d::from_csv`]). A
    /// relative path is one from the working directory.
    File(PathBuf),
}

/// One row of an antenna's table.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct GainRow {
    /// The angle off boresight in degrees, counter-clockwise from above.
    pub angle_deg: f64,
    /// The gain in dB.
    pub gain_db: f64,
}

/// A [`Cardioid`]'s figures.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct CardioidConfig {
    /// Front-to-back ratio, in dB.
    pub front_to_back_db: f64,
}

impl Default for CardioidConfig {
    /// 20 dB.
    fn default() -> Self {
        Self { front_to_back_db: 20.0 }
    }
}

/// A [`Patch`]'s figures.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct PatchConfig {
    /// The half-power beamwidth over azimuth, in degrees.
    pub azimuth_beamwidth_deg: f64,
    /// The half-power beamwidth over elevation, in degrees.
    pub elevation_beamwidth_deg: f64,
    /// Front-to-back ratio, in dB.
    pub front_to_back_db: f64,
}

impl Default for PatchConfig {
    /// 70° both ways, 17 dB, which makes 9.0 dBi without losses. The patch of Pritzl 2018 has
    /// 8 dBi; the widths are ours.
    fn default() -> Self {
        Self { azimuth_beamwidth_deg: 70.0, elevation_beamwidth_deg: 70.0, front_to_back_db: 17.0 }
    }
}

/// A [`Yagi`]'s figures.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct YagiConfig {
    /// Number of elements.
    pub elements: u16,
    /// Spacing of the elements in wavelengths.
    pub spacing_wavelengths: f64,
    /// Front-to-back ratio, in dB.
    pub front_to_back_db: f64,
}

impl Default for YagiConfig {
    /// Five elements a quarter of a wavelength apart, 20 dB.
    fn default() -> Self {
        Self { elements: 5, spacing_wavelengths: 0.25, front_to_back_db: 20.0 }
    }
}

impl AntennaConfig {
    /// The antennas that have a name and need no more.
    pub const NAMES: [&str; 6] =
        ["reference-patch", "isotropic", "dipole", "cardioid", "patch", "yagi"];

    /// The one of this name, with the usual figures where it has any.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Some(match name {
            "reference-patch" => Self::ReferencePatch,
            "isotropic" => Self::Isotropic,
            "dipole" => Self::Dipole,
            "cardioid" => Self::Cardioid(CardioidConfig::default()),
            "patch" => Self::Patch(PatchConfig::default()),
            "yagi" => Self::Yagi(YagiConfig::default()),
            _ => return None,
        })
    }

    /// Builds the antenna; reads its file, if it is one.
    ///
    /// # Errors
    ///
    /// [`AntennaError`] names the parameter or the row that is out of range, or the file and line.
    pub fn build(&self) -> Result<SharedAntenna, AntennaError> {
        Ok(match self {
            Self::ReferencePatch => Arc::clone(&REFERENCE_PATCH),
            Self::Isotropic => Arc::new(Isotropic),
            Self::Dipole => Arc::new(Dipole),
            Self::Cardioid(config) => Arc::new(Cardioid::new(config.front_to_back_db)?),
            Self::Patch(config) => Arc::new(Patch::new(
                config.azimuth_beamwidth_deg.to_radians(),
                config.elevation_beamwidth_deg.to_radians(),
                config.front_to_back_db,
            )?),
            Self::Yagi(config) => Arc::new(Yagi::new(
                config.elements,
                config.spacing_wavelengths,
                config.front_to_back_db,
            )?),
            Self::Table(rows) => {
                let rows: Vec<_> =
                    rows.iter().map(|r| (r.angle_deg.to_radians(), r.gain_db)).collect();
                Arc::new(PatternTable::from_rows(&rows)?)
            }
            Self::File(path) => read(path)?,
        })
    }
}

#[cfg(feature = "serde")]
mod reading {
    use std::{fmt, path::PathBuf, vec::Vec};

    use serde::{
        Deserialize, Deserializer,
        de::{Error, MapAccess, Visitor, value::MapAccessDeserializer},
    };

    use super::{AntennaConfig, CardioidConfig, GainRow, PatchConfig, YagiConfig};

    impl<'de> Deserialize<'de> for AntennaConfig {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            deserializer.deserialize_any(NameOrTable)
        }
    }

    /// A table of one antenna with its figures: the derived form, which takes a bare name only
    /// where there are no figures.
    #[derive(Deserialize)]
    #[serde(remote = "AntennaConfig", rename_all = "kebab-case")]
    enum Figures {
        ReferencePatch,
        Isotropic,
        Dipole,
        Cardioid(CardioidConfig),
        Patch(PatchConfig),
        Yagi(YagiConfig),
        Table(Vec<GainRow>),
        File(PathBuf),
    }

    struct NameOrTable;

    impl<'de> Visitor<'de> for NameOrTable {
        type Value = AntennaConfig;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("the name of an antenna, or a table of its figures")
        }

        fn visit_str<E: Error>(self, name: &str) -> Result<AntennaConfig, E> {
            let unknown = || E::unknown_variant(name, &AntennaConfig::NAMES);
            AntennaConfig::named(name).ok_or_else(unknown)
        }

        fn visit_map<A: MapAccess<'de>>(self, table: A) -> Result<AntennaConfig, A::Error> {
            Figures::deserialize(MapAccessDeserializer::new(table))
        }
    }
}

/// Reads a file by its extension.
fn read(path: &Path) -> Result<SharedAntenna, AntennaError> {
    let file = || path.display().to_string();
    let text = || {
        // Vendors write their names in the encodings of the last century.
        let bytes = fs::read(path)
            .map_err(|error| AntennaError::Read { file: file(), reason: error.to_string() })?;
        Ok::<_, AntennaError>(String::from_utf8_lossy(&bytes).into_owned())
    };
    let refused = |source| AntennaError::File { file: file(), source };
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    match extension.as_str() {
        "msi" | "pln" => {
            let antenna = MsiFile::parse(&text()?).map_err(refused)?.antenna()?;
            Ok(Arc::new(antenna))
        }
        "csv" => {
            let text = text()?;
            if text.trim_start_matches('\u{feff}').trim_start().starts_with("elevation_deg") {
                return Ok(Arc::new(PatternTable3d::from_csv(&text).map_err(refused)?));
            }
            Ok(Arc::new(PatternTable::from_csv(&text).map_err(refused)?))
        }
        _ => Err(AntennaError::Extension { file: file(), extension }),
    }
}
