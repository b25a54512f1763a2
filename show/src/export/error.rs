//! Formats of exports, and the errors in writing them.

use std::{path::Path, str::FromStr};

/// Reason why nothing was exported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The file's ending belongs to no known format.
    #[error(
        "unknown ending {ending:?}; an export ends in .geojson, .json, .kml, .czml, .gpx, .csv, \
         .cot, .mcap, .tif, .tiff, .kmz, .mbtiles or .png"
    )]
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
    /// Tiles are not in this build.
    #[error("MBTiles are not in this build: build with the feature `store`")]
    NoTiles,
    /// Nothing was found that could be shown as a raster.
    #[error("there is no place, and so no probability of cells")]
    NoBelief,
    /// Text could not be put together.
    #[error("the export cannot be written")]
    Write(#[source] Box<dyn std::error::Error + Send + Sync>),
}

impl ExportError {
    pub(super) fn write(error: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::Write(Box::new(error))
    }
}

/// A format of another program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// GeoJSON (RFC 7946): a collection of features.
    GeoJson,
    /// KML 2.2.
    Kml,
    /// CZML 1.0, the JSON of Cesium: receivers move in time.
    Czml,
    /// GPX 1.1: fixes as waypoints, paths, bearings and ellipses as tracks.
    Gpx,
    /// A table of receptions and fixes, in degrees where there is an origin, and in local metres.
    Csv,
    /// Cursor on Target 2.0, one event for each line.
    Cot,
    /// MCAP with messages of Foxglove's schemas in JSON.
    Mcap,
    /// GeoTIFF 1.1: the probability of each cell and of the region that holds it, a page for each
    /// search.
    GeoTiff,
    /// Picture of the beliefs as an overlay on the ground, in zipped KML 2.2.
    Kmz,
    /// Picture of the beliefs as tiles (MBTiles 1.3).
    MbTiles,
    /// Picture of the beliefs, North up.
    Png,
}

impl Format {
    /// Every format, by the ending of its files.
    pub const ENDINGS: [(&str, Self); 13] = [
        ("geojson", Self::GeoJson),
        ("json", Self::GeoJson),
        ("kml", Self::Kml),
        ("czml", Self::Czml),
        ("gpx", Self::Gpx),
        ("csv", Self::Csv),
        ("cot", Self::Cot),
        ("mcap", Self::Mcap),
        ("tif", Self::GeoTiff),
        ("tiff", Self::GeoTiff),
        ("kmz", Self::Kmz),
        ("mbtiles", Self::MbTiles),
        ("png", Self::Png),
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

    /// Refuses what [`export`](super::export) would, before there is anything to export.
    /// `has_origin` is true if it is known where the zero of local metres is on Earth, `has_time`
    /// if the time of day is known.
    ///
    /// # Errors
    ///
    /// [`ExportError`] where the format needs what is not known, or is not in this build.
    pub fn check(self, has_origin: bool, has_time: bool) -> Result<(), ExportError> {
        match self {
            Self::Mcap if !cfg!(feature = "mcap") => Err(ExportError::NotBuilt),
            Self::MbTiles if !cfg!(feature = "sqlite") => Err(ExportError::NoTiles),
            Self::Csv | Self::Png => Ok(()),
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
