//! Beliefs as GeoTIFF 1.1, one page for each search: the probability of each cell, and of the
//! smallest region that holds it.

use std::io::Cursor;

use foxhunt_wire::geodesy::{Geodetic, LocalFrame};
use tiff::{
    TiffError,
    encoder::{Compression, DeflateLevel, TiffEncoder, colortype::Gray32Float},
    tags::{ExtraSamples, Tag},
};

use super::ExportError;
use crate::{
    overview::Overview,
    raster::{Raster, belief, level},
};

/// GDAL's own names of bands.
const GDAL_METADATA: Tag = Tag::Unknown(42_112);

pub(super) fn write(overview: &Overview, frame: &LocalFrame) -> Result<Vec<u8>, ExportError> {
    let mut file = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut file)
        .map_err(ExportError::write)?
        .with_compression(Compression::Deflate(DeflateLevel::default()));
    let origin = frame.origin();
    let mut pages = Vec::new();
    if let Some(searched) = &overview.searched {
        let pod = Raster::from(searched);
        let poa = Raster { values: searched.poa(), ..pod.clone() };
        let bands = [("POD: probability of detection", pod), ("POA after the search", poa)];
        pages.push(Page { name: "searched", bands, origin });
    }
    for search in &overview.searches {
        let Some(raster) = belief(search) else { continue };
        let held = raster.cumulative();
        let bands = [
            ("probability of the cell", raster),
            ("probability of the region that holds the cell", held),
        ];
        pages.push(Page { name: &search.name, bands, origin });
    }
    let levels: Vec<String> =
        overview.searches.iter().map(|search| format!("level of {}", search.name)).collect();
    for (index, name) in levels.iter().enumerate() {
        let Some([mean, sigma]) = level(overview, index) else { continue };
        let mean_of = if overview.relative_levels { "level in dB" } else { "level in dBm" };
        pages.push(Page { name, bands: [(mean_of, mean), ("its sigma in dB", sigma)], origin });
    }
    for page in &pages {
        page.write(&mut encoder).map_err(ExportError::write)?;
    }
    if pages.is_empty() { Err(ExportError::NoBelief) } else { Ok(file.into_inner()) }
}

/// A page of the file.
struct Page<'a> {
    name: &'a str,
    /// Names and values of the bands, of the same cells.
    bands: [(&'static str, Raster); 2],
    origin: Geodetic,
}

impl Page<'_> {
    fn write(&self, encoder: &mut TiffEncoder<&mut Cursor<Vec<u8>>>) -> Result<(), TiffError> {
        let [(_, first), (_, second)] = &self.bands;
        let Raster { corner, cell_m, columns, .. } = *first;
        let rows = first.rows();
        let [width, height] = [columns, rows].map(|side| u32::try_from(side).unwrap_or(u32::MAX));
        let mut image = encoder.new_image::<Gray32Float>(width, height)?;
        image.extra_samples(&[ExtraSamples::Unspecified])?;
        let tags = image.encoder();
        let north = first.far_corner().y;
        tags.write_tag(Tag::ModelPixelScaleTag, &[cell_m, cell_m, 0.0][..])?;
        tags.write_tag(Tag::ModelTiepointTag, &[0.0, 0.0, 0.0, corner.x, north, 0.0][..])?;
        let (keys, doubles, text) = self.keys();
        tags.write_tag(Tag::GeoKeyDirectoryTag, &keys[..])?;
        tags.write_tag(Tag::GeoDoubleParamsTag, &doubles[..])?;
        tags.write_tag(Tag::GeoAsciiParamsTag, text.as_str())?;
        let name: String = self.name.chars().map(|c| if c.is_ascii() { c } else { '?' }).collect();
        tags.write_tag(Tag::ImageDescription, name.replace('\0', " ").as_str())?;
        let items: String = (self.bands.iter().enumerate())
            .map(|(band, (name, _))| {
                let about = "name=\"DESCRIPTION\" role=\"description\"";
                format!("<Item sample=\"{band}\" {about}>{name}</Item>")
            })
            .collect();
        let metadata = format!("<GDALMetadata>{items}</GDALMetadata>");
        tags.write_tag(GDAL_METADATA, metadata.as_str())?;
        let cells = first.values.iter().zip(&second.values);
        #[expect(clippy::cast_possible_truncation, reason = "seven digits are enough")]
        let both: Vec<f32> = cells.flat_map(|(a, b)| [*a as f32, *b as f32]).collect();
        // Pictures begin in the North.
        let from_north: Vec<f32> =
            both.chunks(2 * columns.max(1)).rev().flatten().copied().collect();
        image.write_data(&from_north)
    }

    /// Returns the keys of a transverse Mercator projection about the origin, with their numbers
    /// and their text. Within 10 km its metres equal the local frame's to millimetres, as it
    /// has the scale of the origin's height.
    fn keys(&self) -> (Vec<u16>, Vec<f64>, String) {
        let Geodetic { lat_deg, lon_deg, alt_m } = self.origin;
        let text = "East and North of foxhunt's origin|WGS 84|".to_owned();
        let scale = 1.0 + alt_m / mean_radius_m(lat_deg);
        let doubles = vec![lon_deg, lat_deg, 0.0, 0.0, scale];
        let [value, of_doubles, of_text] = [0, 34_736, 34_737];
        let user_defined = 32_767;
        let keys: [[u16; 4]; 15] = [
            [1024, value, 1, 1],            // projected
            [1025, value, 1, 1],            // pixels are areas
            [1026, of_text, 35, 0],         // citation
            [2048, value, 1, 4326],         // WGS 84
            [2049, of_text, 7, 35],         // its name
            [2054, value, 1, 9102],         // degrees
            [3072, value, 1, user_defined], // projected system
            [3074, value, 1, user_defined], // projection
            [3075, value, 1, 1],            // transverse Mercator
            [3076, value, 1, 9001],         // metres
            [3080, of_doubles, 1, 0],       // longitude of the origin
            [3081, of_doubles, 1, 1],       // latitude of the origin
            [3082, of_doubles, 1, 2],       // false East
            [3083, of_doubles, 1, 3],       // false North
            [3092, of_doubles, 1, 4],       // scale at the origin
        ];
        let mut directory = vec![1, 1, 1, 15];
        directory.extend(keys.iter().flatten());
        (directory, doubles, text)
    }
}

/// Mean radius of curvature of the ellipsoid at a latitude, in metres.
fn mean_radius_m(lat_deg: f64) -> f64 {
    const SEMI_MINOR_M: f64 = 6_356_752.314;
    const ECCENTRICITY_SQUARED: f64 = 6.694_379_990_14e-3;
    let sin = libm::sin(lat_deg.to_radians());
    SEMI_MINOR_M / (1.0 - ECCENTRICITY_SQUARED * sin * sin)
}
