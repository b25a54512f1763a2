use std::{fs, path::Path};

use serde::{Deserialize, Serialize};

use super::{BearingSection, CalibrationFileError, PathLossSection, StationSection};

/// The version of the file that this program writes and reads.
pub const CALIBRATION_VERSION: u32 = 1;

/// Calibrations that come with the program, by the format of the recordings that they are for.
const SHIPPED: [(&str, &str); 1] =
    [("uri-yagi-station", include_str!("../../calibrations/uri-yagi-station.toml"))];

/// What `foxhunt calibrate --out` writes, and `--calibration` of the other commands reads.
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
    /// How power falls with range; not known where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path_loss: Option<PathLossSection>,
    /// How bearings err; as they are where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bearings: Option<BearingSection>,
    /// The antennas of a station; an antenna that turns where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub station: Option<StationSection>,
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
            station: None,
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

    /// Reads a calibration from a TOML file.
    ///
    /// # Errors
    ///
    /// [`CalibrationFileError`] names the file, and the line or the number that is wrong.
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
    pub fn parse(text: &str, file: &str) -> Result<Self, CalibrationFileError> {
        let read: Self = toml::from_str(text)
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
            path_loss.law().map_err(wrong("path_loss"))?;
        }
        if let Some(bearings) = &read.bearings {
            let nothing = foxhunt_sensors::Pritzl2018::default();
            bearings.correction.wrap(nothing).map_err(wrong("bearings.correction"))?;
        }
        if let Some(station) = &read.station {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::{BearingCalibration, StationAntennaSection};

    fn whole() -> CalibrationFile {
        let antenna = |deg: f64| StationAntennaSection {
            recorded_deg_compass: deg,
            boresight_deg_compass: deg + 1.0 / 3.0,
            half_interval_deg: Some(2.0),
            gain_db: -0.1,
            site_db: vec![0.1, -0.2],
        };
        CalibrationFile {
            recordings: vec!["a.csv".to_owned()],
            beacon: Some("fox".to_owned()),
            path_loss: Some(PathLossSection {
                p0_dbm: -29.06,
                exponent: 2.765,
                covariance: Some([[1.0, 0.1], [0.1, 0.03]]),
                at_bound: false,
                sigma_db: Some(2.5),
                points: Some(15),
            }),
            bearings: Some(BearingSection {
                extractor: Some("pritzl2018".to_owned()),
                bearings: Some(12),
                correction: BearingCalibration { offset_deg_ccw: 8.6, ..<_>::default() },
                half_intervals_deg: Some([1.0, 0.0, 0.0]),
                sigma_scale_interval: Some([0.1, 0.3]),
                sigma_floor_interval_deg: Some([0.0, 1.0]),
            }),
            station: Some(StationSection {
                beamwidth_deg: 36.0,
                front_to_back_db: 16.0,
                residual_db: 4.8,
                floor_dbm: Some(-107.0),
                floor_width_db: 1.2,
                antennas: vec![antenna(65.0), antenna(245.0)],
            }),
            ..CalibrationFile::default()
        }
    }

    #[test]
    fn what_is_written_is_read_back_to_the_bit() {
        for file in [whole(), CalibrationFile::default()] {
            assert_eq!(
                CalibrationFile::parse(&file.to_toml(), "c.toml").expect("as written"),
                file
            );
        }
    }

    #[test]
    fn what_comes_with_the_program_is_in_order() {
        for (name, _) in SHIPPED {
            assert!(CalibrationFile::shipped(name).is_some_and(|file| file.station.is_some()));
        }
        assert_eq!(CalibrationFile::shipped("no-such-format"), None);
    }

    #[test]
    fn mistakes_are_named() {
        let text = whole().to_toml();
        for (from, to, expected) in [
            ("exponent = 2.765", "exponent = -1.0", "path_loss: exponent is -1"),
            ("sigma_scale = 1.0", "sigma_scale = -1.0", "bearings.correction: scale is -1"),
            ("beamwidth_deg = 36.0", "beamwidth_deg = 190.0", "station: beamwidth"),
            ("foxhunt_calibration = 1", "foxhunt_calibration = 7", "is 7; this program reads 1"),
            ("beacon = \"fox\"", "becon = \"fox\"", "becon"),
        ] {
            assert!(text.contains(from), "{from}: {text}");
            let error = CalibrationFile::parse(&text.replace(from, to), "c.toml").expect_err(to);
            let error = error.to_string();
            assert!(error.starts_with("c.toml") && error.contains(expected), "{to}: {error}");
        }
    }
}
