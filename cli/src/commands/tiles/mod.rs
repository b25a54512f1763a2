//! Map tiles from this computer: a folder z/x/y, MBTiles, PMTiles. They are tiles of Web Mercator
//! (EPSG:3857), counted from the North-West.

mod sources;

#[cfg(feature = "live")]
pub(super) use sources::Tile;
pub(super) use sources::TileAt;

use std::{fmt, path::Path};

use foxhunt::{
    overview::Overview,
    page::{Ground, LiveTiles},
};

use self::sources::{TileSource, image_type};
use crate::{
    error::{CliError, InFile},
    output::warn,
};

/// Reason why `--tiles` is refused without a place on Earth.
pub(super) const NO_PLACE: &str =
    "--tiles: the places are in local metres; --origin LAT,LON places them on Earth";

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
        let (source, about) = sources::open(path).map_err(|error| {
            let file = format!("--tiles {}", path.display());
            CliError::input(InFile { file, source: Box::new(error) })
        })?;
        Ok(Self { source, about })
    }

    /// Returns the part of the map about an overview, for its page to bring along; warns if the
    /// map has no tile there.
    pub(super) fn under(&self, overview: &Overview) -> Option<Ground> {
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
    pub(super) fn about(&self) -> &LiveTiles {
        &self.about
    }

    /// Returns a tile with its type, or `None` if it is missing or not an image.
    #[cfg(feature = "live")]
    pub(super) fn tile(&self, at: TileAt) -> Option<Tile> {
        let bytes = self.image(at)?;
        let content_type = image_type(&bytes)?;
        Some(Tile { bytes, content_type })
    }
}

#[cfg(test)]
mod tests;
