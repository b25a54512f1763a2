use std::{fs, path::Path};

use super::{
    TerrainError,
    tile::{Area, Grid, Tile, count},
};

/// Value of a height that is not known.
const VOID: i16 = -32_768;

/// Reads a tile of SRTM if it meets the area: big-endian heights in metres, rows from the North,
/// the outermost on the edges of the square degree that its name gives by its south-western corner
/// (NASA LP DAAC, SRTM User Guide).
pub(super) fn read(path: &Path, area: &Area) -> Result<Option<Tile>, TerrainError> {
    let wrong = |reason: String| TerrainError::Tile { path: path.to_owned(), reason };
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let Some((south, west)) = corner(&name) else {
        return Err(wrong("its name is not that of a square degree, such as N50E014.hgt".into()));
    };
    // The grid of any number of samples to a side meets what the degree meets.
    let degree = |side: usize| Grid {
        north: south + 1.0,
        west,
        lat_step: 1.0 / count(side - 1),
        lon_step: 1.0 / count(side - 1),
        rows: side,
        columns: side,
    };
    if !degree(3601).meets(area) {
        return Ok(None);
    }
    let bytes =
        fs::read(path).map_err(|source| TerrainError::Read { path: path.to_owned(), source })?;
    let samples = bytes.len() / 2;
    let side = samples.isqrt();
    if side < 2 || side * side * 2 != bytes.len() {
        let length = bytes.len();
        return Err(wrong(format!("{length} bytes are no square of heights of 2 bytes")));
    }
    let height = |index: usize| {
        let height = i16::from_be_bytes([bytes[2 * index], bytes[2 * index + 1]]);
        if height == VOID { f32::NAN } else { f32::from(height) }
    };
    Ok(Some(Tile::cut(path.to_owned(), degree(side), area, height)))
}

/// Latitude and longitude of the south-western corner out of a tile's name.
fn corner(name: &str) -> Option<(f64, f64)> {
    let signed = |text: &str, positive: char, negative: char, most: i32| {
        let mut letters = text.chars();
        let letter = letters.next()?.to_ascii_uppercase();
        let digits = letters.as_str();
        let plain = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
        let degrees: i32 = digits.parse().ok().filter(|d| plain && *d <= most)?;
        match letter {
            _ if letter == positive => Some(f64::from(degrees)),
            _ if letter == negative => Some(-f64::from(degrees)),
            _ => None,
        }
    };
    let lat = name.get(..3)?;
    let lon = name.get(3..7)?;
    (name.len() == 7).then_some(())?;
    Some((signed(lat, 'N', 'S', 90)?, signed(lon, 'E', 'W', 180)?))
}
