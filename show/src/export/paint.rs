//! Rasters as pictures: PNG, and tiles of it.

use std::io::{self, Write as _};

use flate2::{Compression, Crc, write::ZlibEncoder};
use nalgebra::Vector2;

use crate::{
    overview::Overview,
    raster::{Raster, belief},
};

/// Cumulative probabilities, each with the opacity of its colour in the page.
const CREDIBLE: [(f64, f64); 3] = [(0.5, 0.62), (0.8, 0.4), (0.95, 0.22)];

/// Red, green and blue of the searches, in turn, as in the page by day.
const SEARCHES: [[u8; 3]; 4] =
    [[0xd5, 0x5e, 0x00], [0x7b, 0x32, 0x94], [0x00, 0x62, 0x4a], [0x8c, 0x51, 0x0a]];

/// Share of the largest value that cells at the border of a picture have at least.
const LEAST_SHARE: f64 = 1e-4;

/// Pixels with red, green, blue and opacity, row by row from the North.
pub(super) struct Picture {
    width: u32,
    height: u32,
    pixels: Vec<u8>,
}

/// Colour of what was searched in silence, and its opacity where a transmitter would surely have
/// been received.
const SEARCHED: ([u8; 3], f64) = ([0x5b, 0x7c, 0x99], 0.7);

/// Values of a raster, and how they are painted.
enum Shade {
    /// Cumulative probabilities, in steps.
    Regions,
    /// Probabilities of detection.
    Detection,
}

/// Layers of an overview, each with its colour.
pub(super) struct Paint {
    layers: Vec<(Raster, [u8; 3], Shade)>,
}

impl Paint {
    /// Returns the area that was searched and the beliefs of all searches; `None` without either.
    pub(super) fn of(overview: &Overview) -> Option<Self> {
        let colours = SEARCHES.iter().cycle();
        let beliefs = overview.searches.iter().zip(colours).filter_map(|(search, colour)| {
            let held = belief(search)?.cropped(LEAST_SHARE);
            Some((held.cumulative(), *colour, Shade::Regions))
        });
        let searched = overview.searched.iter();
        let searched = searched.map(|of| (Raster::from(of), SEARCHED.0, Shade::Detection));
        let layers: Vec<_> = searched.chain(beliefs).collect();
        (!layers.is_empty()).then_some(Self { layers })
    }

    /// Returns the corners of all cells, south-west and north-east.
    pub(super) fn corners(&self) -> (Vector2<f64>, Vector2<f64>) {
        let corners = self.layers.iter().map(|(raster, ..)| (raster.corner, raster.far_corner()));
        let widest = corners.reduce(|(low, high), (a, b)| (low.inf(&a), high.sup(&b)));
        widest.unwrap_or_default()
    }

    /// Returns the side of the smallest cell in metres.
    #[cfg(feature = "sqlite")]
    pub(super) fn cell_m(&self) -> f64 {
        self.layers.iter().map(|(raster, ..)| raster.cell_m).fold(f64::INFINITY, f64::min)
    }

    /// Returns red, green, blue and opacity at a place.
    fn at(&self, place: &Vector2<f64>) -> [u8; 4] {
        let mut over = [0.0; 3];
        let mut opacity = 0.0;
        for (raster, colour, shade) in &self.layers {
            let Some(value) = raster.between(place) else { continue };
            let own = match shade {
                Shade::Regions => {
                    CREDIBLE.iter().find(|(most, _)| value <= *most).map_or(0.0, |(_, own)| *own)
                }
                Shade::Detection => SEARCHED.1 * value,
            };
            for (sum, channel) in over.iter_mut().zip(colour) {
                *sum = f64::from(*channel) * own + *sum * (1.0 - own);
            }
            opacity = own + opacity * (1.0 - own);
        }
        if opacity <= 0.0 {
            return [0; 4];
        }
        let [red, green, blue] = over.map(|sum| byte(sum / opacity));
        [red, green, blue, byte(255.0 * opacity)]
    }

    /// Returns the picture of a place for each pixel, by column and row from the North-West.
    pub(super) fn picture(
        &self,
        width: u32,
        height: u32,
        place: impl Fn(f64, f64) -> Vector2<f64>,
    ) -> Picture {
        let mut pixels = Vec::with_capacity(4 * width as usize * height as usize);
        for row in 0..height {
            for column in 0..width {
                let place = place(f64::from(column) + 0.5, f64::from(row) + 0.5);
                pixels.extend(self.at(&place));
            }
        }
        Picture { width, height, pixels }
    }
}

fn byte(value: f64) -> u8 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
    let byte = value.round().clamp(0.0, 255.0) as u8;
    byte
}

impl Picture {
    /// Returns true if nothing is painted on it.
    #[cfg(feature = "sqlite")]
    pub(super) fn is_empty(&self) -> bool {
        self.pixels.chunks(4).all(|pixel| pixel.last() == Some(&0))
    }

    /// Returns the picture as PNG.
    pub(super) fn png(&self) -> io::Result<Vec<u8>> {
        let mut rows = ZlibEncoder::new(Vec::new(), Compression::default());
        for row in self.pixels.chunks(4 * self.width as usize) {
            // No filter.
            rows.write_all(&[0])?;
            rows.write_all(row)?;
        }
        let mut head = [self.width.to_be_bytes(), self.height.to_be_bytes()].concat();
        // Eight bits, RGB with opacity, the only compression and filters, in the order of rows.
        head.extend([8, 6, 0, 0, 0]);
        let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
        for (kind, data) in [(b"IHDR", head), (b"IDAT", rows.finish()?), (b"IEND", Vec::new())] {
            let length = u32::try_from(data.len()).map_err(io::Error::other)?;
            png.extend(length.to_be_bytes());
            png.extend(kind);
            png.extend(&data);
            let mut sum = Crc::new();
            sum.update(kind);
            sum.update(&data);
            png.extend(sum.sum().to_be_bytes());
        }
        Ok(png)
    }
}

/// Pixels along the longer side of a picture by itself.
const SIDE: f64 = 1000.0;

/// Width and height in pixels of a picture of an area.
pub(super) fn size(area: &Vector2<f64>) -> (u32, u32) {
    let pixels = area.map(|side| (SIDE * side / area.max()).round().clamp(1.0, SIDE));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to SIDE")]
    let size = (pixels.x as u32, pixels.y as u32);
    size
}

/// Returns a picture of the beliefs, North up, on a transparent ground.
pub(super) fn png(paint: &Paint) -> io::Result<Vec<u8>> {
    let (low, high) = paint.corners();
    let area = high - low;
    let (width, height) = size(&area);
    let metres = area.max() / SIDE;
    paint.picture(width, height, |x, y| Vector2::new(low.x + x * metres, high.y - y * metres)).png()
}
