//! Tiles of heights, and the files that they are read from: GeoTIFF in degrees, and SRTM's `.hgt`.

use std::{
    fs::{self, File},
    io::{self, BufReader},
    path::{Path, PathBuf},
};

use tiff::{
    TiffError,
    decoder::{Decoder, DecodingResult},
    tags::Tag,
};

/// Extent of a tile beyond its outermost samples, in steps: tiles of areas share no samples, and
/// half a step to either side of the border belongs to each.
const HALF: f64 = 0.5 + 1e-6;

/// Keys of the GeoTIFF standard (OGC 19-008r4, 7.1 and 7.2): the kind of coordinates, and whether a
/// sample stands for its cell or for a point.
const MODEL_TYPE: u16 = 1024;
const RASTER_TYPE: u16 = 1025;

/// Coordinates are latitudes and longitudes.
const GEOGRAPHIC: u16 = 2;

/// Samples stand for points.
const POINTS: u16 = 2;

/// Value of a height that is not known.
const VOID: i16 = -32_768;

/// A rectangle in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Area {
    pub south: f64,
    pub north: f64,
    pub west: f64,
    pub east: f64,
}

/// Layout of a tile's samples.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Grid {
    /// Latitude of the first row and longitude of the first column, in degrees.
    pub north: f64,
    pub west: f64,
    /// Steps from row to row southwards and from column to column eastwards, in degrees.
    lat_step: f64,
    lon_step: f64,
    rows: usize,
    columns: usize,
}

/// The samples of a tile within an area, row by row from the North.
#[derive(Clone, Debug)]
pub(super) struct Tile {
    pub path: PathBuf,
    grid: Grid,
    heights: Vec<f32>,
}

impl Grid {
    /// Returns true if it has samples within half a step of an area.
    fn meets(&self, area: &Area) -> bool {
        let south = self.north - self.lat_step * count(self.rows - 1);
        let east = self.west + self.lon_step * count(self.columns - 1);
        let lat = HALF * self.lat_step;
        let lon = HALF * self.lon_step;
        south - lat <= area.north
            && self.north + lat >= area.south
            && self.west - lon <= area.east
            && east + lon >= area.west
    }

    /// Row and column of a place, in steps, if it is within `beyond` steps of the samples; the
    /// samples at the border stand for the places beyond them.
    fn index(&self, lat_deg: f64, lon_deg: f64, beyond: f64) -> Option<(f64, f64)> {
        let row = (self.north - lat_deg) / self.lat_step;
        let column = (lon_deg - self.west) / self.lon_step;
        let last_row = count(self.rows - 1);
        let last_column = count(self.columns - 1);
        let inside = |at: f64, last: f64| (-beyond..=last + beyond).contains(&at);
        (inside(row, last_row) && inside(column, last_column))
            .then(|| (row.clamp(0.0, last_row), column.clamp(0.0, last_column)))
    }
}

impl Tile {
    /// Keeps the samples of `all` that are needed within `area`, which the grid meets.
    fn cut(path: PathBuf, grid: Grid, area: &Area, all: impl Fn(usize) -> f32) -> Self {
        let span = |from: f64, to: f64, samples: usize| {
            let last = samples - 1;
            let first = whole(from.floor() - 1.0).min(last);
            (first, whole(to.ceil() + 1.0).min(last))
        };
        let row = |lat: f64| (grid.north - lat) / grid.lat_step;
        let column = |lon: f64| (lon - grid.west) / grid.lon_step;
        let (top, bottom) = span(row(area.north), row(area.south), grid.rows);
        let (left, right) = span(column(area.west), column(area.east), grid.columns);
        let heights = (top..=bottom)
            .flat_map(|row| (left..=right).map(move |column| row * grid.columns + column))
            .map(all)
            .collect();
        let grid = Grid {
            north: grid.north - grid.lat_step * count(top),
            west: grid.west + grid.lon_step * count(left),
            rows: bottom - top + 1,
            columns: right - left + 1,
            ..grid
        };
        Self { path, grid, heights }
    }

    /// The height at a place within `beyond` half steps of the samples, bilinear between them.
    pub(super) fn height(&self, lat_deg: f64, lon_deg: f64, beyond: bool) -> Option<f64> {
        let beyond = if beyond { HALF } else { 1e-9 };
        let (row, column) = self.grid.index(lat_deg, lon_deg, beyond)?;
        let top = whole(row.floor());
        let left = whole(column.floor());
        let down = row.fract();
        let along = column.fract();
        let at = |row: usize, column: usize| {
            let row = row.min(self.grid.rows - 1);
            let column = column.min(self.grid.columns - 1);
            f64::from(self.heights[row * self.grid.columns + column])
        };
        let upper = at(top, left) * (1.0 - along) + at(top, left + 1) * along;
        let lower = at(top + 1, left) * (1.0 - along) + at(top + 1, left + 1) * along;
        Some(upper * (1.0 - down) + lower * down)
    }

    /// The heights of its samples.
    pub(super) fn heights(&self) -> impl Iterator<Item = f64> + '_ {
        self.heights.iter().map(|height| f64::from(*height))
    }

    /// Latitude and longitude of the first void sample, if there is one.
    pub(super) fn void(&self) -> Option<(f64, f64)> {
        let index = self.heights.iter().position(|height| !height.is_finite())?;
        let row = index / self.grid.columns;
        let column = index % self.grid.columns;
        Some((
            self.grid.north - self.grid.lat_step * count(row),
            self.grid.west + self.grid.lon_step * count(column),
        ))
    }

    /// Steps from sample to sample, southwards and eastwards in degrees.
    pub(super) fn steps(&self) -> (f64, f64) {
        (self.grid.lat_step, self.grid.lon_step)
    }
}

#[expect(clippy::cast_precision_loss, reason = "far below 2⁵³ samples to a side")]
fn count(samples: usize) -> f64 {
    samples as f64
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the cast saturates, which is the clamp that is wanted"
)]
fn whole(index: f64) -> usize {
    index as usize
}

/// Reads a GeoTIFF in degrees if it meets the area: its first image, of one number to a sample, of
/// any width, compressed by deflate, LZW or not at all; its void is that of GDAL's tag.
pub(super) fn read_geotiff(path: &Path, area: &Area) -> Result<Option<Tile>, TerrainError> {
    let file =
        File::open(path).map_err(|source| TerrainError::Read { path: path.to_owned(), source })?;
    let wrong = |reason: String| TerrainError::Tile { path: path.to_owned(), reason };
    let failed = |error: TiffError| wrong(error.to_string());
    let mut tiff = Decoder::new(BufReader::new(file)).map_err(failed)?;
    let grid = grid(&mut tiff).map_err(wrong)?;
    if !grid.meets(area) {
        return Ok(None);
    }
    let void = match tiff.find_tag(Tag::GdalNodata).map_err(failed)? {
        Some(value) => {
            let text = value.into_string().map_err(failed)?;
            let text = text.trim_matches(['\0', ' ']);
            let number = text.parse::<f64>();
            Some(number.map_err(|_| wrong(format!("GDAL_NODATA is {text:?}, no number")))?)
        }
        None => None,
    };
    let samples = tiff.read_image().map_err(failed)?;
    let heights = heights(samples).map_err(wrong)?;
    if heights.len() != grid.rows * grid.columns {
        return Err(wrong(format!(
            "{} numbers for {} samples; one to a sample is read",
            heights.len(),
            grid.rows * grid.columns
        )));
    }
    #[expect(clippy::cast_possible_truncation, reason = "as the samples are kept")]
    let is_void = |height: f32| void.is_some_and(|void| (height - void as f32).abs() <= 0.0);
    let height = |index: usize| if is_void(heights[index]) { f32::NAN } else { heights[index] };
    Ok(Some(Tile::cut(path.to_owned(), grid, area, height)))
}

fn grid(tiff: &mut Decoder<BufReader<File>>) -> Result<Grid, String> {
    let failed = |error: TiffError| error.to_string();
    let (columns, rows) = tiff.dimensions().map_err(failed)?;
    let numbers = |tiff: &mut Decoder<BufReader<File>>, tag: Tag, name: &str| {
        let value = tiff.find_tag(tag).map_err(failed)?;
        let value = value
            .ok_or_else(|| format!("the tag {name} is missing, so the file is not a GeoTIFF"))?;
        value.into_f64_vec().map_err(failed)
    };
    let keys = tiff.find_tag(Tag::GeoKeyDirectoryTag).map_err(failed)?;
    let keys = keys.ok_or("the tag GeoKeyDirectory is missing, so the file is not a GeoTIFF")?;
    let keys = keys.into_u16_vec().map_err(failed)?;
    // Four numbers to a key, after a header of four; a value of its own has the location 0.
    let key = |wanted| {
        let found = keys.chunks_exact(4).skip(1).find(|key| key[0] == wanted && key[1] == 0);
        found.map(|key| key[3])
    };
    if key(MODEL_TYPE) != Some(GEOGRAPHIC) {
        return Err("its coordinates are no latitudes and longitudes; reproject it to EPSG:4326 \
                    (gdalwarp -t_srs EPSG:4326)"
            .into());
    }
    let scale = numbers(tiff, Tag::ModelPixelScaleTag, "ModelPixelScale")?;
    let tie = numbers(tiff, Tag::ModelTiepointTag, "ModelTiepoint")?;
    let ([lon_step, lat_step, ..], [column, row, _, lon, lat, ..]) = (&scale[..], &tie[..]) else {
        return Err("ModelPixelScale or ModelTiepoint is too short".into());
    };
    let steps = *lon_step > 0.0 && *lat_step > 0.0 && lon_step.max(*lat_step).is_finite();
    if !steps || ![column, row, lon, lat].iter().all(|x| x.is_finite()) {
        return Err(format!("steps of {lat_step}° and {lon_step}° from {lat}°, {lon}°"));
    }
    // The tie point of cells is a corner, and samples are in the middle.
    let middle = if key(RASTER_TYPE) == Some(POINTS) { 0.0 } else { 0.5 };
    let side = |samples: u32| usize::try_from(samples).map_err(|error| error.to_string());
    let rows = side(rows)?;
    let columns = side(columns)?;
    if rows < 2 || columns < 2 {
        return Err(format!("{rows} rows of {columns} samples"));
    }
    Ok(Grid {
        north: lat + (row - middle) * lat_step,
        west: lon - (column - middle) * lon_step,
        lat_step: *lat_step,
        lon_step: *lon_step,
        rows,
        columns,
    })
}

#[expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    reason = "heights on Earth are far below 2²⁴ m, and f32 has their millimetres"
)]
fn heights(samples: DecodingResult) -> Result<Vec<f32>, String> {
    Ok(match samples {
        DecodingResult::U8(all) => all.into_iter().map(f32::from).collect(),
        DecodingResult::I8(all) => all.into_iter().map(f32::from).collect(),
        DecodingResult::U16(all) => all.into_iter().map(f32::from).collect(),
        DecodingResult::I16(all) => all.into_iter().map(f32::from).collect(),
        DecodingResult::U32(all) => all.into_iter().map(|x| x as f32).collect(),
        DecodingResult::I32(all) => all.into_iter().map(|x| x as f32).collect(),
        DecodingResult::F32(all) => all,
        DecodingResult::F64(all) => all.into_iter().map(|x| x as f32).collect(),
        _ => {
            return Err(
                "its samples are not heights; integers of 8 to 32 bits and floats are read".into(),
            );
        }
    })
}

/// Reads a tile of SRTM if it meets the area: big-endian heights in metres, rows from the North,
/// the outermost on the edges of the square degree that its name gives by its south-western corner
/// (NASA LP DAAC, SRTM User Guide).
pub(super) fn read_hgt(path: &Path, area: &Area) -> Result<Option<Tile>, TerrainError> {
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
        return Err(wrong(format!(
            "{length} bytes do not make a square of heights of 2 bytes each"
        )));
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

/// Reason that the ground's height is not known.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TerrainError {
    /// The folder or a tile cannot be read.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// The folder or the tile.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A file is no tile.
    #[error("{}: {reason}", path.display())]
    Tile {
        /// The file.
        path: PathBuf,
        /// The fault.
        reason: String,
    },
    /// No tile has a place that is needed.
    #[error(
        "{}: no tile has {lat_deg:.5}°, {lon_deg:.5}°; {tile}.hgt or a GeoTIFF of that square \
         degree is missing", folder.display()
    )]
    Missing {
        /// The folder.
        folder: PathBuf,
        /// The square degree, as SRTM's tiles are named.
        tile: String,
        /// Latitude of the place in degrees.
        lat_deg: f64,
        /// Longitude of the place in degrees.
        lon_deg: f64,
    },
    /// A height that is needed is void.
    #[error("{}: the height at {lat_deg:.5}°, {lon_deg:.5}° is void", path.display())]
    Void {
        /// The tile.
        path: PathBuf,
        /// Latitude of the sample in degrees.
        lat_deg: f64,
        /// Longitude of the sample in degrees.
        lon_deg: f64,
    },
    /// The reach of the area is out of its range.
    #[error("reach_m is {reach_m}; more than 0 and at most 50000 is allowed")]
    Reach {
        /// Distance from the origin that it was to reach, in metres.
        reach_m: f64,
    },
    /// The area is no rectangle in degrees: it is too near to a pole or to the 180th meridian.
    #[error("the area about {lat_deg}°, {lon_deg}° reaches a pole or the 180th meridian")]
    Edge {
        /// Latitude of the origin in degrees.
        lat_deg: f64,
        /// Longitude of the origin in degrees.
        lon_deg: f64,
    },
}
