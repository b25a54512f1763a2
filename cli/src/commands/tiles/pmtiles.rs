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
use serde::Deserialize;
use tokio::runtime::{Builder, Runtime};

use super::{
    TileAt,
    error::TilesError,
    source::{Opened, TileSource, zooms},
};

/// Tiles in an archive (PMTiles 3).
struct PmTiles {
    reader: AsyncPmTilesReader<Plain>,
    runtime: Mutex<Runtime>,
}

/// File that is read when a tile is needed. A file mapped into memory would end the program if the
/// medium is pulled out.
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

/// Optional contents of the archive's metadata.
#[derive(Default, Deserialize)]
struct Metadata {
    attribution: Option<String>,
}

pub(super) fn open(path: &Path) -> Opened {
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

/// Returns the end of the tiles by the header, in whose bytes 56 to 72 they begin and have their
/// length.
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
