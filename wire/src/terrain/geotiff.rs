use std::{fs::File, io::BufReader, path::Path};

use tiff::{
    TiffError,
    decoder::{Decoder, DecodingResult},
    tags::Tag,
};

use super::{
    TerrainError,
    tile::{Area, Grid, Tile},
};

/// Keys of the GeoTIFF standard (OGC 19-008r4, 7.1 and 7.2): the kind of coordinates, and whether a
/// sample stands for its cell or for a point.
const MODEL_TYPE: u16 = 1024;
const RASTER_TYPE: u16 = 1025;
/// Coordinates are latitudes and longitudes.
const GEOGRAPHIC: u16 = 2;
/// Samples stand for points.
const POINTS: u16 = 2;

/// Reads a GeoTIFF in degrees if it meets the area: its first image, of one number to a sample, of
/// any width, compressed by deflate, LZW or not at all; its void is that of GDAL's tag.
pub(super) fn read(path: &Path, area: &Area) -> Result<Option<Tile>, TerrainError> {
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
        let value = value.ok_or_else(|| format!("there is no {name}: it is no GeoTIFF"))?;
        value.into_f64_vec().map_err(failed)
    };
    let keys = tiff.find_tag(Tag::GeoKeyDirectoryTag).map_err(failed)?;
    let keys = keys.ok_or("there is no GeoKeyDirectory: it is no GeoTIFF")?;
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
        _ => return Err("its samples are no heights: 8 to 32 bits or floats are read".into()),
    })
}
