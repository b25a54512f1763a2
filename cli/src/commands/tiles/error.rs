use std::io;

#[cfg(not(all(feature = "live", feature = "store")))]
use crate::hints;

/// Reason why a map cannot be used.
#[derive(Debug, thiserror::Error)]
pub(super) enum TilesError {
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
