//! Map tiles from this computer: a folder z/x/y, MBTiles, PMTiles. They are tiles of Web Mercator
//! (EPSG:3857), counted from the North-West.

use std::{
    fmt, fs,
    io::{self, Read as _},
    path::{Path, PathBuf},
};

use foxhunt::{
    overview::Overview,
    page::{Ground, LiveTiles},
};
use serde::Deserialize;

#[cfg(not(all(feature = "live", feature = "store")))]
use crate::hints;
use crate::{
    error::{CliError, InFile},
    output::warn,
};

/// Maximum zoom level; no map has as many.
const DEEPEST: u8 = 30;

/// A tile of the map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileAt {
    zoom: u8,
    /// Column, counted from the West.
    column: u32,
    /// Row, counted from the North.
    row: u32,
}

impl TileAt {
    /// Returns the tile, if it can exist.
    pub fn new(zoom: u8, column: u32, row: u32) -> Option<Self> {
        let side = 1_u32.checked_shl(zoom.into()).filter(|_| zoom <= DEEPEST)?;
        (column < side && row < side).then_some(Self { zoom, column, row })
    }
}

/// An image of a tile.
#[cfg(feature = "live")]
#[derive(Debug, PartialEq, Eq)]
pub struct Tile {
    pub bytes: Vec<u8>,
    /// Media type for HTTP.
    pub content_type: &'static str,
}

/// Returns the media type of an image by its first bytes, whatever its name is.
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

/// Reason why a map cannot be used.
#[derive(Debug, thiserror::Error)]
enum TilesError {
    #[error("cannot be read")]
    Read(#[from] io::Error),
    #[error("it has no tile z/x/y.png, .jpg, .jpeg, .webp or .avif")]
    NoTiles,
    #[error("it is neither a folder of tiles z/x/y, nor MBTiles, nor PMTiles")]
    Unknown,
    #[cfg(any(feature = "live", feature = "store"))]
    #[error("its tiles are {0}; images are needed: PNG, JPEG, WebP or AVIF")]
    NoImages(String),
    #[cfg(feature = "live")]
    #[error("it is cut short: {length} bytes of {needed}")]
    CutShort { length: u64, needed: u64 },
    #[error("the zoom levels {0} to {1} are out of range")]
    Zooms(i64, i64),
    #[cfg(feature = "store")]
    #[error("it is not an MBTiles file, or damaged")]
    Sqlite(#[from] rusqlite::Error),
    #[cfg(feature = "live")]
    #[error("it is not a PMTiles file, or damaged")]
    PmTiles(#[from] ::pmtiles::PmtError),
    #[cfg(not(feature = "live"))]
    #[error("PMTiles need a build with the feature live: {}", hints::build("live"))]
    NoPmTiles,
    #[cfg(not(feature = "store"))]
    #[error("MBTiles need a build with the feature store: {}", hints::build("store"))]
    NoSqlite,
}

/// Source of tiles.
trait TileSource: Send + Sync {
    /// Returns the bytes of a tile, if it exists and can be read.
    fn tile(&self, at: TileAt) -> Option<Vec<u8>>;
}

/// An opened map, or the reason why it cannot be opened.
type Opened = Result<(Box<dyn TileSource>, LiveTiles), TilesError>;

/// The zoom levels of a map, the least and the greatest.
fn zooms(least: i64, greatest: i64) -> Result<[u8; 2], TilesError> {
    let zoom = |zoom: i64| u8::try_from(zoom).ok().filter(|zoom| *zoom <= DEEPEST);
    match (zoom(least), zoom(greatest)) {
        (Some(least), Some(greatest)) if least <= greatest => Ok([least, greatest]),
        _ => Err(TilesError::Zooms(least, greatest)),
    }
}

/// The endings that tiles may have.
const ENDINGS: [&str; 5] = ["png", "jpg", "jpeg", "webp", "avif"];

/// Tiles in files z/x/y.png.
struct Folder {
    path: PathBuf,
}

/// Optional contents of a map's metadata: of `metadata.json` beside the tiles, as `mb-util` writes
/// it, and of an archive.
#[derive(Default, Deserialize)]
struct Metadata {
    attribution: Option<String>,
}

fn open_folder(path: &Path) -> Opened {
    let mut levels = Vec::new();
    for entry in fs::read_dir(path)? {
        let name = entry?.file_name();
        levels.extend(name.to_str().and_then(|name| name.parse::<u8>().ok()));
    }
    levels.retain(|level| holds_a_tile(&path.join(level.to_string())));
    let least = levels.iter().min().ok_or(TilesError::NoTiles)?;
    let greatest = levels.iter().max().ok_or(TilesError::NoTiles)?;
    let zooms = zooms((*least).into(), (*greatest).into())?;
    let metadata = fs::read_to_string(path.join("metadata.json")).unwrap_or_default();
    let Metadata { attribution } = serde_json::from_str(&metadata).unwrap_or_default();
    Ok((Box::new(Folder { path: path.to_owned() }), LiveTiles { zooms, attribution }))
}

/// Returns true if some column of a level holds a file with an ending of tiles.
fn holds_a_tile(level: &Path) -> bool {
    let entries = |path: &Path| fs::read_dir(path).into_iter().flatten().flatten();
    let is_tile = |name: PathBuf| {
        let ending = name.extension().and_then(|ending| ending.to_str());
        ending.is_some_and(|ending| ENDINGS.contains(&ending))
    };
    entries(level).any(|column| entries(&column.path()).any(|tile| is_tile(tile.path())))
}

impl TileSource for Folder {
    fn tile(&self, TileAt { zoom, column, row }: TileAt) -> Option<Vec<u8>> {
        let column = self.path.join(zoom.to_string()).join(column.to_string());
        ENDINGS.iter().find_map(|ending| fs::read(column.join(format!("{row}.{ending}"))).ok())
    }
}

/// Opens a folder of tiles, or a file of them.
fn open(path: &Path) -> Opened {
    if path.is_dir() { open_folder(path) } else { open_file(path) }
}

/// Opens a file by its first bytes.
fn open_file(path: &Path) -> Opened {
    let mut begin = Vec::new();
    let _ = fs::File::open(path)?.take(16).read_to_end(&mut begin)?;
    match begin.as_slice() {
        #[cfg(feature = "store")]
        begin if begin.starts_with(b"SQLite format 3\0") => mbtiles::open(path),
        #[cfg(not(feature = "store"))]
        begin if begin.starts_with(b"SQLite format 3\0") => Err(TilesError::NoSqlite),
        #[cfg(feature = "live")]
        begin if begin.starts_with(b"PMTiles") => pmtiles::open(path),
        #[cfg(not(feature = "live"))]
        begin if begin.starts_with(b"PMTiles") => Err(TilesError::NoPmTiles),
        _ => Err(TilesError::Unknown),
    }
}

/// Reason why `--tiles` is refused without a place on Earth.
pub const NO_PLACE: &str =
    "--tiles: the places are in local metres; --origin LAT,LON places them on Earth";

/// A map.
pub struct Tiles {
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
    pub fn open(path: &Path) -> Result<Self, CliError> {
        let (source, about) = open(path).map_err(|error| {
            let file = format!("--tiles {}", path.display());
            CliError::input(InFile { file, source: Box::new(error) })
        })?;
        Ok(Self { source, about })
    }

    /// Returns the part of the map about an overview, for its page to bring along; warns if the
    /// map has no tile there.
    pub fn under(&self, overview: &Overview) -> Option<Ground> {
        let LiveTiles { zooms, attribution } = self.about.clone();
        let image = |zoom, column, row| self.image(TileAt::new(zoom, column, row)?);
        let ground = Ground::about(overview, zooms, attribution, image);
        if ground.is_none() {
            warn(match overview.frame {
                Some(_) => "--tiles: the map has no tile at this place; the page is without it",
                None => "--tiles: the places are in local metres; the page is without the map",
            });
        }
        ground
    }

    /// Returns the bytes of a tile, or `None` if it is missing or not an image.
    fn image(&self, at: TileAt) -> Option<Vec<u8>> {
        self.source.tile(at).filter(|bytes| image_type(bytes).is_some())
    }

    /// Returns the description of the map for a page.
    #[cfg(any(feature = "live", test))]
    pub fn about(&self) -> &LiveTiles {
        &self.about
    }

    /// Returns a tile with its type, or `None` if it is missing or not an image.
    #[cfg(feature = "live")]
    pub fn tile(&self, at: TileAt) -> Option<Tile> {
        let bytes = self.image(at)?;
        let content_type = image_type(&bytes)?;
        Some(Tile { bytes, content_type })
    }
}

/// Tiles in SQLite.
#[cfg(feature = "store")]
mod mbtiles {
    use std::{
        path::Path,
        sync::{Mutex, PoisonError},
    };

    use foxhunt::page::LiveTiles;
    use rusqlite::{Connection, OpenFlags, OptionalExtension, params};

    use super::{Opened, TileAt, TileSource, TilesError, image_type, zooms};

    /// Tiles in SQLite (MBTiles 1.3).
    struct MbTiles {
        connection: Mutex<Connection>,
    }

    const TILE: &str =
        "SELECT tile_data FROM tiles WHERE zoom_level = ?1 AND tile_column = ?2 AND tile_row = ?3";

    pub fn open(path: &Path) -> Opened {
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let connection = Connection::open_with_flags(path, flags)?;
        let value = |name: &str| -> Option<String> {
            let query = "SELECT value FROM metadata WHERE name = ?1";
            // A table that is not there, or a number in it, is no metadata.
            connection.query_row(query, [name], |row| row.get(0)).ok()
        };
        let one = "SELECT tile_data FROM tiles LIMIT 1";
        let one: Option<Vec<u8>> = connection.query_row(one, [], |row| row.get(0)).optional()?;
        let one = one.ok_or(TilesError::NoTiles)?;
        if image_type(&one).is_none() {
            let format = value("format").unwrap_or_else(|| "of an unknown format".to_owned());
            return Err(TilesError::NoImages(format));
        }
        let levels = "SELECT min(zoom_level), max(zoom_level) FROM tiles";
        let (least, greatest) =
            connection.query_row(levels, [], |row| Ok((row.get(0)?, row.get(1)?)))?;
        let about = LiveTiles { zooms: zooms(least, greatest)?, attribution: value("attribution") };
        Ok((Box::new(MbTiles { connection: Mutex::new(connection) }), about))
    }

    impl TileSource for MbTiles {
        fn tile(&self, TileAt { zoom, column, row }: TileAt) -> Option<Vec<u8>> {
            // Its rows are counted from the South.
            let from_south = (1_u32 << zoom) - 1 - row;
            let connection = self.connection.lock().unwrap_or_else(PoisonError::into_inner);
            let mut query = connection.prepare_cached(TILE).ok()?;
            query.query_row(params![zoom, column, from_south], |row| row.get(0)).ok()
        }
    }
}

/// Tiles in one archive.
#[cfg(feature = "live")]
mod pmtiles {
    use std::{
        fs::File,
        io::{Read as _, Seek as _, SeekFrom},
        path::Path,
        sync::{Mutex, PoisonError},
    };

    use foxhunt::page::LiveTiles;
    use pmtiles::{
        AsyncBackend, AsyncPmTilesReader, BackendResponse, PmtError, PmtResult, TileCoord, TileType,
    };
    use tokio::runtime::{Builder, Runtime};

    use super::{Metadata, Opened, TileAt, TileSource, TilesError, zooms};

    /// Tiles in an archive (PMTiles 3).
    struct PmTiles {
        reader: AsyncPmTilesReader<Plain>,
        runtime: Mutex<Runtime>,
    }

    /// File that is read when a tile is needed. A file mapped into memory would end the program if
    /// the medium is pulled out.
    struct Plain {
        file: Mutex<File>,
        length: u64,
    }

    impl AsyncBackend for Plain {
        async fn read(&self, offset: u64, length: usize) -> PmtResult<BackendResponse> {
            // A damaged directory may have any length in it.
            let left = usize::try_from(self.length.saturating_sub(offset)).unwrap_or(usize::MAX);
            let mut bytes = vec![0; length.min(left)];
            let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
            file.seek(SeekFrom::Start(offset)).map_err(PmtError::Reading)?;
            file.read_exact(&mut bytes).map_err(PmtError::Reading)?;
            Ok(BackendResponse::new(bytes.into()))
        }
    }

    pub fn open(path: &Path) -> Opened {
        let mut file = File::open(path)?;
        let length = file.metadata()?.len();
        let needed = end_of_data(&mut file)?;
        if length < needed {
            return Err(TilesError::CutShort { length, needed });
        }
        let runtime = Builder::new_current_thread().build()?;
        let plain = Plain { file: Mutex::new(file), length };
        let reader = runtime.block_on(AsyncPmTilesReader::try_from_source(plain))?;
        let header = reader.get_header();
        let is_image = matches!(
            header.tile_type,
            TileType::Png | TileType::Jpeg | TileType::Webp | TileType::Avif
        );
        if !is_image {
            return Err(TilesError::NoImages(header.tile_type.content_type().to_owned()));
        }
        let zooms = zooms(header.min_zoom.into(), header.max_zoom.into())?;
        let metadata = runtime.block_on(reader.get_metadata()).unwrap_or_default();
        let Metadata { attribution } = serde_json::from_str(&metadata).unwrap_or_default();
        let source = PmTiles { reader, runtime: Mutex::new(runtime) };
        Ok((Box::new(source), LiveTiles { zooms, attribution }))
    }

    /// Returns the end of the tiles by the header, in whose bytes 56 to 72 they begin and have
    /// their length.
    fn end_of_data(file: &mut File) -> Result<u64, TilesError> {
        let mut number = |at: u64| {
            let mut bytes = [0; 8];
            file.seek(SeekFrom::Start(at))?;
            file.read_exact(&mut bytes)?;
            Ok::<_, std::io::Error>(u64::from_le_bytes(bytes))
        };
        Ok(number(56)?.saturating_add(number(64)?))
    }

    impl TileSource for PmTiles {
        fn tile(&self, TileAt { zoom, column, row }: TileAt) -> Option<Vec<u8>> {
            let at = TileCoord::new(zoom, column, row).ok()?;
            let runtime = self.runtime.lock().unwrap_or_else(PoisonError::into_inner);
            let tile = runtime.block_on(self.reader.get_tile_decompressed(at)).ok()??;
            Some(tile.into())
        }
    }
}

#[cfg(test)]
mod tests;
