//! Map tiles from this computer: a folder z/x/y, MBTiles, PMTiles. They are tiles of Web Mercator
//! (EPSG:3857), counted from the North-West.

mod error;
mod folder;
#[cfg(feature = "store")]
mod mbtiles;
mod pmtiles;
mod source;
mod tile;

pub(super) use tile::{Tile, TileAt};

use std::{fmt, fs, io::Read as _, path::Path};

use foxhunt::page::LiveTiles;

use self::{
    error::TilesError,
    source::{Opened, TileSource},
    tile::image_type,
};
use crate::error::{CliError, InFile};

/// A map.
pub(in crate::commands) struct Tiles {
    source: Box<dyn TileSource>,
    about: LiveTiles,
}

impl fmt::Debug for Tiles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Tiles").field("about", &self.about).finish_non_exhaustive()
    }
}

impl Tiles {
    /// Opens a map; a faulty one is refused before anything flies.
    pub(in crate::commands) fn open(path: &Path) -> Result<Self, CliError> {
        let opened = if path.is_dir() { folder::open(path) } else { file(path) };
        let (source, about) = opened.map_err(|error| {
            let file = format!("--tiles {}", path.display());
            CliError::input(InFile { file, source: Box::new(error) })
        })?;
        Ok(Self { source, about })
    }

    /// Returns the description of the map for a page.
    pub(super) fn about(&self) -> &LiveTiles {
        &self.about
    }

    /// Returns the tile, or `None` if it is missing or not an image.
    pub(super) fn tile(&self, at: TileAt) -> Option<Tile> {
        let bytes = self.source.tile(at)?;
        let content_type = image_type(&bytes)?;
        Some(Tile { bytes, content_type })
    }
}

/// Opens a file by its first bytes.
fn file(path: &Path) -> Opened {
    let mut begin = Vec::new();
    let _ = fs::File::open(path)?.take(16).read_to_end(&mut begin)?;
    match begin.as_slice() {
        #[cfg(feature = "store")]
        begin if begin.starts_with(b"SQLite format 3\0") => mbtiles::open(path),
        #[cfg(not(feature = "store"))]
        begin if begin.starts_with(b"SQLite format 3\0") => Err(TilesError::NoSqlite),
        begin if begin.starts_with(b"PMTiles") => pmtiles::open(path),
        _ => Err(TilesError::Unknown),
    }
}

#[cfg(test)]
mod tests;
