//! Many points in a few characters: four for each, two of 12 bits each for either number.

use serde::Serialize;

use crate::raster::Raster;

const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// The largest of 12 bits.
const MOST: u16 = 4095;

/// Points within a box, each number in 4095 steps of its range.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Points {
    /// The least of both numbers.
    from: [f64; 2],
    /// Extent of both numbers beyond the least.
    size: [f64; 2],
    /// The points, four characters each, the more significant first.
    points: String,
}

impl Points {
    /// Packs points; points that are not finite are left out.
    pub(super) fn new(points: impl Iterator<Item = [f64; 2]> + Clone) -> Self {
        let finite = points.filter(|point| point.iter().all(|v| v.is_finite()));
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for [x, y] in finite.clone() {
            low = [low[0].min(x), low[1].min(y)];
            high = [high[0].max(x), high[1].max(y)];
        }
        let mut packed = String::new();
        for [x, y] in finite {
            for (value, (low, high)) in [x, y].into_iter().zip(low.into_iter().zip(high)) {
                let step = if high > low { (value - low) / (high - low) } else { 0.0 };
                push(&mut packed, step);
            }
        }
        if packed.is_empty() {
            (low, high) = ([0.0; 2], [0.0; 2]);
        }
        Self { from: low, size: [high[0] - low[0], high[1] - low[1]], points: packed }
    }
}

/// Values of cells, each in 4095 steps of its range, two characters each.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Cells {
    /// The corner that is farthest south and west.
    corner: [f64; 2],
    /// Side of a cell in metres.
    cell: f64,
    columns: usize,
    low: f64,
    high: f64,
    /// From the South-West to the East, then row by row to the North.
    numbers: String,
}

impl Cells {
    /// Packs the values between two bounds.
    pub(super) fn new(raster: &Raster, [low, high]: [f64; 2]) -> Self {
        let mut numbers = String::with_capacity(2 * raster.values.len());
        for value in &raster.values {
            push(&mut numbers, if high > low { (value - low) / (high - low) } else { 0.0 });
        }
        let corner = [raster.corner.x, raster.corner.y];
        Self { corner, cell: raster.cell_m, columns: raster.columns, low, high, numbers }
    }
}

/// Adds a number from 0 to 1.
fn push(packed: &mut String, share: f64) {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 4095")]
    let steps = (share.clamp(0.0, 1.0) * f64::from(MOST)).round() as u16;
    for six_bits in [steps >> 6, steps & 63] {
        packed.push(char::from(ALPHABET.get(usize::from(six_bits)).copied().unwrap_or(b'A')));
    }
}

/// Returns bytes in base64 (RFC 4648) with its padding.
pub(super) fn base64(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let byte = |index: usize| u32::from(three.get(index).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for (index, shift) in [18, 12, 6, 0].into_iter().enumerate() {
            let letter = ALPHABET.get((bits >> shift & 63) as usize).copied().unwrap_or(b'A');
            text.push(if index > three.len() { '=' } else { char::from(letter) });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_of_rfc_4648() {
        for (bytes, text) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }

    #[test]
    fn points_in_four_characters() {
        let points =
            Points::new([[1.0, -2.0], [3.0, 2.0], [2.0, 0.0], [f64::NAN, 0.0]].into_iter());
        assert_eq!((points.from, points.size), ([1.0, -2.0], [2.0, 4.0]));
        // 0, 4095 and 2048 of 4095 in six bits each.
        assert_eq!(points.points, "AAAA////gAgA");
        let none = Points::new(std::iter::empty::<[f64; 2]>());
        assert_eq!((none.from, none.points), ([0.0; 2], String::new()));
    }
}
