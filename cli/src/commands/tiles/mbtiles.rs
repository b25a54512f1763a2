use std::{
    path::Path,
    sync::{Mutex, PoisonError},
};

use foxhunt::page::LiveTiles;
use rusqlite::{Connection, OpenFlags, OptionalExtension, params};

use super::{
    TileAt,
    error::TilesError,
    source::{Opened, TileSource, zooms},
    tile::image_type,
};

/// Tiles in SQLite (MBTiles 1.3).
struct MbTiles {
    connection: Mutex<Connection>,
}

const TILE: &str =
    "SELECT tile_data FROM tiles WHERE zoom_level = ?1 AND tile_column = ?2 AND tile_row = ?3";

pub(super) fn open(path: &Path) -> Opened {
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
