//! Places, bearings, ellipses, regions and paths in the formats of other programs: GeoJSON, KML,
//! GPX, CSV, Cursor on Target, and MCAP with Foxglove's schemas (feature `mcap`).
//!
//! Coordinates are WGS84. Heights are left out where a format does without: those of local frames
//! are above the frame's origin, whose own height is often not known.

mod cot;
mod feature;
mod geojson;
mod gpx;
mod kml;
#[cfg(feature = "mcap")]
mod mcap;
mod table;
mod xml;

use std::{path::Path, str::FromStr};

use foxhunt_wire::geodesy::LocalFrame;

use crate::overview::Overview;

/// A format of another program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// GeoJSON (RFC 7946): a collection of features.
    GeoJson,
    /// KML 2.2.
    Kml,
    /// GPX 1.1: fixes as waypoints, paths, bearings and ellipses as tracks.
    Gpx,
    /// A table of receptions and fixes, in degrees where there is an origin, and in local metres.
    Csv,
    /// Cursor on Target 2.0, one event for each line.
    Cot,
    /// MCAP with messages of Foxglove's schemas in JSON.
    Mcap,
}

impl Format {
    /// Every format, by the ending of its files.
    pub const ENDINGS: [(&str, Self); 7] = [
        ("geojson", Self::GeoJson),
        ("json", Self::GeoJson),
        ("kml", Self::Kml),
        ("gpx", Self::Gpx),
        ("csv", Self::Csv),
        ("cot", Self::Cot),
        ("mcap", Self::Mcap),
    ];

    /// The format of a file, by its ending.
    ///
    /// # Errors
    ///
    /// [`ExportError::Ending`] where it is none of [`ENDINGS`](Self::ENDINGS).
    pub fn of_file(path: &Path) -> Result<Self, ExportError> {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        ending.unwrap_or_default().parse()
    }
}

impl Format {
    /// Refuses what [`export`] would, before there is anything to export: `has_origin` is whether
    /// it is known where the zero of local metres is on Earth, `has_time` whether the time of day
    /// is.
    ///
    /// # Errors
    ///
    /// [`ExportError`] where the format needs what is not known, or is not in this build.
    pub fn check(self, has_origin: bool, has_time: bool) -> Result<(), ExportError> {
        match self {
            Self::Mcap if !cfg!(feature = "mcap") => Err(ExportError::NotBuilt),
            Self::Csv => Ok(()),
            _ if !has_origin => Err(ExportError::NoOrigin),
            Self::Cot if !has_time => Err(ExportError::NoTime),
            _ => Ok(()),
        }
    }
}

impl FromStr for Format {
    type Err = ExportError;

    fn from_str(ending: &str) -> Result<Self, ExportError> {
        let known = Self::ENDINGS.iter().find(|(known, _)| *known == ending);
        known
            .map(|(_, format)| *format)
            .ok_or_else(|| ExportError::Ending { ending: ending.to_owned() })
    }
}

/// Why nothing was exported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The file's ending is that of no format.
    #[error("the ending {ending:?} is none of .geojson, .json, .kml, .gpx, .csv, .cot and .mcap")]
    Ending {
        /// The ending.
        ending: String,
    },
    /// Places are in local metres of an origin that is not known.
    #[error(
        "the places are in metres from an origin whose latitude and longitude are not known; give \
         them with --origin LAT,LON"
    )]
    NoOrigin,
    /// The format needs the time of day, and only seconds since the beginning are known.
    #[error(
        "the format needs times in UTC, and only seconds since the beginning are known; give that \
         of the beginning with --start-utc"
    )]
    NoTime,
    /// The format is not in this build.
    #[error("MCAP is not in this build: build with the feature `mcap`")]
    NotBuilt,
    /// Text could not be put together.
    #[error("the export cannot be written")]
    Write(#[source] Box<dyn std::error::Error + Send + Sync>),
}

impl ExportError {
    fn write(error: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::Write(Box::new(error))
    }
}

/// The bytes of a file in a format.
///
/// # Errors
///
/// [`ExportError`] where the format needs an origin or a time that the overview does not have.
pub fn export(overview: &Overview, format: Format) -> Result<Vec<u8>, ExportError> {
    format.check(overview.frame.is_some(), overview.epoch_unix_s.is_some())?;
    let frame = || overview.frame.ok_or(ExportError::NoOrigin);
    match format {
        Format::GeoJson => geojson::write(overview, &frame()?),
        Format::Kml => kml::write(overview, &frame()?),
        Format::Gpx => gpx::write(overview, &frame()?),
        Format::Csv => table::write(overview),
        Format::Cot => cot::write(overview, &frame()?),
        Format::Mcap => mcap_of(overview, &frame()?),
    }
}

#[cfg(feature = "mcap")]
fn mcap_of(overview: &Overview, frame: &LocalFrame) -> Result<Vec<u8>, ExportError> {
    mcap::write(overview, frame)
}

#[cfg(not(feature = "mcap"))]
fn mcap_of(_: &Overview, _: &LocalFrame) -> Result<Vec<u8>, ExportError> {
    Err(ExportError::NotBuilt)
}

#[cfg(test)]
mod tests;
