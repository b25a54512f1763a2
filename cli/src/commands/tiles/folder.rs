use std::{
    fs,
    path::{Path, PathBuf},
};

use foxhunt::page::LiveTiles;
use serde::Deserialize;

use super::{
    TileAt,
    error::TilesError,
    source::{Opened, TileSource, zooms},
};

/// The endings that tiles may have.
const ENDINGS: [&str; 5] = ["png", "jpg", "jpeg", "webp", "avif"];

/// Tiles in files z/x/y.png.
struct Folder {
    path: PathBuf,
}

/// Optional contents of `metadata.json` beside the tiles, as `mb-util` writes it.
#[derive(Default, Deserialize)]
struct Metadata {
    attribution: Option<String>,
}

pub(super) fn open(path: &Path) -> Opened {
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
