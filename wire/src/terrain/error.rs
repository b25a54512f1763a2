use std::{io, path::PathBuf};

/// Reason that the ground's height is not known.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TerrainError {
    /// The folder or a tile cannot be read.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// The folder or the tile.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A file is no tile.
    #[error("{}: {reason}", path.display())]
    Tile {
        /// The file.
        path: PathBuf,
        /// The fault.
        reason: String,
    },
    /// No tile has a place that is needed.
    #[error(
        "{}: no tile has {lat_deg:.5}°, {lon_deg:.5}°; {tile}.hgt or a GeoTIFF of that square \
         degree is missing", folder.display()
    )]
    Missing {
        /// The folder.
        folder: PathBuf,
        /// The square degree, as SRTM's tiles are named.
        tile: String,
        /// Latitude of the place in degrees.
        lat_deg: f64,
        /// Longitude of the place in degrees.
        lon_deg: f64,
    },
    /// A height that is needed is void.
    #[error("{}: the height at {lat_deg:.5}°, {lon_deg:.5}° is void", path.display())]
    Void {
        /// The tile.
        path: PathBuf,
        /// Latitude of the sample in degrees.
        lat_deg: f64,
        /// Longitude of the sample in degrees.
        lon_deg: f64,
    },
    /// The reach of the area is out of its range.
    #[error("reach_m is {reach_m}; more than 0 and at most 50000 is allowed")]
    Reach {
        /// Distance from the origin that it was to reach, in metres.
        reach_m: f64,
    },
    /// The area is no rectangle in degrees: it is too near to a pole or to the 180th meridian.
    #[error("the area about {lat_deg}°, {lon_deg}° reaches a pole or the 180th meridian")]
    Edge {
        /// Latitude of the origin in degrees.
        lat_deg: f64,
        /// Longitude of the origin in degrees.
        lon_deg: f64,
    },
}
