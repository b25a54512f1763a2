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
