use foxhunt::page::LiveTiles;

use super::{
    error::TilesError,
    tile::{DEEPEST, TileAt},
};

/// Source of tiles.
pub(super) trait TileSource: Send + Sync {
    /// Returns the bytes of a tile, if it exists and can be read.
    fn tile(&self, at: TileAt) -> Option<Vec<u8>>;
}

/// An opened map, or the reason why it cannot be opened.
pub(super) type Opened = Result<(Box<dyn TileSource>, LiveTiles), TilesError>;

/// The zoom levels of a map, the least and the greatest.
pub(super) fn zooms(least: i64, greatest: i64) -> Result<[u8; 2], TilesError> {
    let zoom = |zoom: i64| u8::try_from(zoom).ok().filter(|zoom| *zoom <= DEEPEST);
    match (zoom(least), zoom(greatest)) {
        (Some(least), Some(greatest)) if least <= greatest => Ok([least, greatest]),
        _ => Err(TilesError::Zooms(least, greatest)),
    }
}
