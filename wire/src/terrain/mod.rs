//! Height of the ground: tiles of elevation models.
//!
//! [`ElevationModel`] reads the tiles about a place out of a folder: SRTM's `.hgt`, and GeoTIFF in
//! degrees such as Copernicus DEM (`.tif`, `.tiff`).

mod model;
mod tile;

pub use model::ElevationModel;
pub use tile::TerrainError;
