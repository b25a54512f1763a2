//! Map tiles from this computer: a folder z/x/y, MBTiles, PMTiles. Tiles are those of Web Mercator
//! (EPSG:3857), counted from the North-West.

mod folder;
#[cfg(feature = "store")]
mod mbtiles;
mod pmtiles;

use std::{
    fmt, fs,
    io::{self, Read as _},
    path::Path,
};

use foxhunt::page::LiveTiles;

use crate::error::{CliError, InFile};
#[cfg(not(feature = "store"))]
use crate::hints;

/// More zoom levels than any map has.
const DEEPEST: u8 = 30;

/// A tile of the map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TileAt {
    zoom: u8,
    /// From the West.
    column: u32,
    /// From the North.
    row: u32,
}

impl TileAt {
    /// A tile, where there can be one.
    pub(super) fn new(zoom: u8, column: u32, row: u32) -> Option<Self> {
        let side = 1_u32.checked_shl(zoom.into()).filter(|_| zoom <= DEEPEST)?;
        (column < side && row < side).then_some(Self { zoom, column, row })
    }
}

/// An image of a tile.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Tile {
    pub(super) bytes: Vec<u8>,
    /// Its type, as HTTP has it.
    pub(super) content_type: &'static str,
}

/// Where tiles lie.
trait TileSource: Send + Sync {
    /// The bytes of a tile, if it is there and can be read.
    fn tile(&self, at: TileAt) -> Option<Vec<u8>>;
}

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

/// Why a map cannot be used.
#[derive(Debug, thiserror::Error)]
pub(super) enum TilesError {
    #[error("cannot be read")]
    Read(#[from] io::Error),
    #[error("there is no tile z/x/y.png in it, nor .jpg, .jpeg, .webp or .avif")]
    NoTiles,
    #[error("it is neither a folder of tiles z/x/y, nor MBTiles, nor PMTiles")]
    Unknown,
    #[error("its tiles are {0}; images are needed: PNG, JPEG, WebP or AVIF")]
    NoImages(String),
    #[error("it is cut short: {length} bytes of {needed}")]
    CutShort { length: u64, needed: u64 },
    #[error("the zoom levels {0} to {1} are none of a map")]
    Zooms(i64, i64),
    #[cfg(feature = "store")]
    #[error("it is no MBTiles, or damaged")]
    Sqlite(#[from] rusqlite::Error),
    #[error("it is no PMTiles, or damaged")]
    PmTiles(#[from] ::pmtiles::PmtError),
    #[cfg(not(feature = "store"))]
    #[error("MBTiles need a build with the feature store: {}", hints::build("live,store"))]
    NoSqlite,
}

impl Tiles {
    /// Opens a map; what is wrong with it is refused before anything flies.
    pub(in crate::commands) fn open(path: &Path) -> Result<Self, CliError> {
        let opened = if path.is_dir() { folder::open(path) } else { file(path) };
        let (source, about) = opened.map_err(|error| {
            let file = format!("--tiles {}", path.display());
            CliError::input(InFile { file, source: Box::new(error) })
        })?;
        Ok(Self { source, about })
    }

    /// What a page has to know of it.
    pub(super) fn about(&self) -> &LiveTiles {
        &self.about
    }

    /// A tile; none where there is none, or no image.
    pub(super) fn tile(&self, at: TileAt) -> Option<Tile> {
        let bytes = self.source.tile(at)?;
        let content_type = image_type(&bytes)?;
        Some(Tile { bytes, content_type })
    }
}

type Opened = Result<(Box<dyn TileSource>, LiveTiles), TilesError>;

/// A file, by how it begins.
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

/// The zoom levels of a map, the least and the greatest.
fn zooms(least: i64, greatest: i64) -> Result<[u8; 2], TilesError> {
    let zoom = |zoom: i64| u8::try_from(zoom).ok().filter(|zoom| *zoom <= DEEPEST);
    match (zoom(least), zoom(greatest)) {
        (Some(least), Some(greatest)) if least <= greatest => Ok([least, greatest]),
        _ => Err(TilesError::Zooms(least, greatest)),
    }
}

/// The type of an image by how it begins, whatever its name is.
fn image_type(bytes: &[u8]) -> Option<&'static str> {
    let at = |from: usize, what: &[u8]| bytes.get(from..).is_some_and(|b| b.starts_with(what));
    match () {
        () if at(0, b"\x89PNG\r\n\x1a\n") => Some("image/png"),
        () if at(0, b"\xff\xd8\xff") => Some("image/jpeg"),
        () if at(0, b"RIFF") && at(8, b"WEBP") => Some("image/webp"),
        () if at(4, b"ftypavif") => Some("image/avif"),
        () => None,
    }
}

#[cfg(test)]
mod tests;
