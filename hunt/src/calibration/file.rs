//! The file of a calibration, and the reasons to refuse one.

use std::{fmt, fs, path::Path};

use foxhunt_sensors::ParameterError;
use serde::{
    Deserialize, Deserializer, Serialize,
    de::{
        MapAccess, SeqAccess, Visitor,
        value::{MapAccessDeserializer, SeqAccessDeserializer},
    },
};

use super::{
    ArraySection, BearingSection, PathLossSection, StationModelSection, StationPlace,
    StationSection,
};
use crate::document;

/// The version of the file that this program writes and reads.
pub const CALIBRATION_VERSION: u32 = 1;

/// Calibrations that come with the program, by the format of the recordings that they are for.
const SHIPPED: [(&str, &str); 1] =
    [("uri-yagi-station", include_str!("../../calibrations/uri-yagi-station.toml"))];

/// A calibration file: `foxhunt calibrate --out` writes it, `--calibration` of others reads it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationFile {
    /// [`CALIBRATION_VERSION`] of the program that wrote it.
    pub foxhunt_calibration: u32,
    /// The recordings that it comes from.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub recordings: Vec<String>,
    /// The beacon that they are of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beacon: Option<String>,
    /// Law of power over range; unknown where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path_loss: Option<PathLossSection>,
    /// Errors of bearings; no correction where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bearings: Option<BearingSection>,
    /// Errors of arrays that do not turn, over the direction; no correction where absent. Each
    /// section is of another receiver, and a section without a name is of the receivers that no
    /// section before it is of.
    #[serde(default, rename = "array", skip_serializing_if = "Vec::is_empty")]
    pub arrays: Vec<ArraySection>,
    /// The model of stations of fixed antennas that have no section of their own; they are read as
    /// antennas that turn where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub station_model: Option<StationModelSection>,
    /// The antennas of stations, one table `[station]` or several `[[station]]`; antennas that turn
    /// where absent. The first one that is of a receiver counts.
    #[serde(
        default,
        rename = "station",
        deserialize_with = "one_or_several",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub stations: Vec<StationSection>,
}

/// A table, or a list of tables.
fn one_or_several<'de, D>(deserializer: D) -> Result<Vec<StationSection>, D::Error>
where
    D: Deserializer<'de>,
{
    struct OneOrSeveral;
    impl<'de> Visitor<'de> for OneOrSeveral {
        type Value = Vec<StationSection>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a table [station] or several [[station]]")
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
            StationSection::deserialize(MapAccessDeserializer::new(map)).map(|one| vec![one])
        }

        fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Self::Value, A::Error> {
            Vec::deserialize(SeqAccessDeserializer::new(list))
        }
    }
    deserializer.deserialize_any(OneOrSeveral)
}

impl Default for CalibrationFile {
    /// An empty one.
    fn default() -> Self {
        Self {
            foxhunt_calibration: CALIBRATION_VERSION,
            recordings: Vec::new(),
            beacon: None,
            path_loss: None,
            bearings: None,
            arrays: Vec::new(),
            station_model: None,
            stations: Vec::new(),
        }
    }
}

impl CalibrationFile {
    /// The calibration that comes with the program for recordings of a format.
    #[must_use]
    pub fn shipped(format: &str) -> Option<Self> {
        let (name, text) = SHIPPED.iter().find(|(known, _)| *known == format)?;
        Some(Self::parse(text, name).expect("a test parses each of them"))
    }

    /// The station of this name at this place.
    #[must_use]
    pub fn station(&self, name: &str, place: Option<StationPlace>) -> Option<&StationSection> {
        self.stations.iter().find(|station| station.is_of(name, place))
    }

    /// Reads a calibration from a TOML file.
    ///
    /// # Errors
    ///
    /// [`CalibrationFileError`] names the file, and the line or the number that is wrong.
    #[inline]
    pub fn read(path: &Path) -> Result<Self, CalibrationFileError> {
        let file = path.display().to_string();
        let text = fs::read_to_string(path)
            .map_err(|source| CalibrationFileError::Read { file: file.clone(), source })?;
        Self::parse(&text, &file)
    }

    /// A calibration from TOML; `file` is what errors call it.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    #[inline]
    pub fn parse(text: &str, file: &str) -> Result<Self, CalibrationFileError> {
        let read: Self = document::from_toml(text)
            .map_err(|source| CalibrationFileError::Parse { file: file.to_owned(), source })?;
        let version = read.foxhunt_calibration;
        if version != CALIBRATION_VERSION {
            let file = file.to_owned();
            return Err(CalibrationFileError::Version {
                file,
                version,
                known: CALIBRATION_VERSION,
            });
        }
        let wrong = |section| {
            let file = file.to_owned();
            move |source| CalibrationFileError::Parameter { file, section, source }
        };
        if let Some(path_loss) = &read.path_loss {
            path_loss.check().map_err(wrong("path_loss"))?;
        }
        if let Some(bearings) = &read.bearings {
            let nothing = foxhunt_sensors::Pritzl2018::default();
            bearings.correction.wrap(nothing).map_err(wrong("bearings.correction"))?;
        }
        if let Some(model) = &read.station_model {
            model.station(&[0.0]).map_err(wrong("station_model"))?;
        }
        for (index, array) in read.arrays.iter().enumerate() {
            let number = index + 1;
            let file = file.to_owned();
            let name = array.name.clone().unwrap_or_default();
            let hides = |before: &ArraySection| before.name.is_none() || before.name == array.name;
            if read.arrays.iter().take(index).any(hides) {
                return Err(CalibrationFileError::ArrayTwice { file, number, name });
            }
            if let Err(source) = array.check() {
                return Err(CalibrationFileError::Array { file, number, name, source });
            }
        }
        for station in &read.stations {
            station.build().map_err(wrong("station"))?;
        }
        Ok(read)
    }

    /// The calibration as TOML; what is read back is the same to the bit.
    #[must_use]
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("plain tables of numbers and texts")
    }
}

/// Reason why a file is no calibration.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationFileError {
    /// The file cannot be read.
    #[error("{file}: cannot be read: {source}")]
    Read {
        /// The file.
        file: String,
        /// Cause of the failure.
        source: std::io::Error,
    },
    /// The file is no calibration; the source names line, field and value.
    #[error("{file}: not a calibration: {source}")]
    Parse {
        /// The file.
        file: String,
        /// Error of the parser.
        source: toml::de::Error,
    },
    /// The file is of another version.
    #[error("{file}: foxhunt_calibration is {version}; this program reads {known}")]
    Version {
        /// The file.
        file: String,
        /// Version of the file.
        version: u32,
        /// Version that this program reads.
        known: u32,
    },
    /// A number of an array is out of its range.
    #[error("{file}: array {number} ({name}): {source}")]
    Array {
        /// The file.
        file: String,
        /// Number of the array, from 1.
        number: usize,
        /// Name of the array; empty without one.
        name: String,
        /// Name of the number, and why it is refused.
        source: ParameterError,
    },
    /// Two arrays are of one receiver, so that the second would never count.
    #[error("{file}: array {number} ({name}): an array before it is of its receiver, too")]
    ArrayTwice {
        /// The file.
        file: String,
        /// Number of the second, from 1.
        number: usize,
        /// Name of the array; empty without one.
        name: String,
    },
    /// A number is out of its range.
    #[error("{file}: {section}: {source}")]
    Parameter {
        /// The file.
        file: String,
        /// Name of the section.
        section: &'static str,
        /// Name of the number, and why it is refused.
        source: ParameterError,
    },
}
