/// Maximum zoom level; no map has as many.
pub(super) const DEEPEST: u8 = 30;

/// A tile of the map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::commands) struct TileAt {
    pub(super) zoom: u8,
    /// Column, counted from the West.
    pub(super) column: u32,
    /// Row, counted from the North.
    pub(super) row: u32,
}

impl TileAt {
    /// Returns the tile, if it can exist.
    pub(in crate::commands) fn new(zoom: u8, column: u32, row: u32) -> Option<Self> {
        let side = 1_u32.checked_shl(zoom.into()).filter(|_| zoom <= DEEPEST)?;
        (column < side && row < side).then_some(Self { zoom, column, row })
    }
}

/// An image of a tile.
#[cfg(feature = "live")]
#[derive(Debug, PartialEq, Eq)]
pub(in crate::commands) struct Tile {
    pub(in crate::commands) bytes: Vec<u8>,
    /// Media type for HTTP.
    pub(in crate::commands) content_type: &'static str,
}

/// Returns the media type of an image by its first bytes, whatever its name is.
pub(super) fn image_type(bytes: &[u8]) -> Option<&'static str> {
    let at = |from: usize, what: &[u8]| bytes.get(from..).is_some_and(|b| b.starts_with(what));
    match () {
        () if at(0, b"\x89PNG\r\n\x1a\n") => Some("image/png"),
        () if at(0, b"\xff\xd8\xff") => Some("image/jpeg"),
        () if at(0, b"RIFF") && at(8, b"WEBP") => Some("image/webp"),
        () if at(4, b"ftypavif") => Some("image/avif"),
        () => None,
    }
}
