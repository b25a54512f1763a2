//! Many numbers in a few characters, for a page: two of base64 for each, in 4095 steps.

use std::{string::String, vec::Vec};

use nalgebra::Vector2;

const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// The largest of 12 bits.
const MOST: u16 = 4095;

/// Points within a box, each coordinate in steps of the box's size.
#[derive(Clone, Debug, PartialEq)]
pub struct PackedPoints {
    /// The least of either coordinate.
    pub from: [f64; 2],
    /// Extent of either coordinate beyond the least.
    pub size: [f64; 2],
    /// The points, four characters each, the more significant of two first.
    pub text: String,
}

/// Packs points; those that are not finite are left out.
#[must_use]
pub fn points(points: &[Vector2<f64>]) -> PackedPoints {
    let finite: Vec<Vector2<f64>> = points
        .iter()
        .filter(|point| point.iter().all(|value| value.is_finite()))
        .copied()
        .collect();
    let Some(first) = finite.first() else {
        return PackedPoints { from: [0.0; 2], size: [0.0; 2], text: String::new() };
    };
    let low = finite.iter().fold(*first, |low, point| low.inf(point));
    let high = finite.iter().fold(*first, |high, point| high.sup(point));
    let mut text = String::with_capacity(4 * finite.len());
    for point in &finite {
        push(&mut text, point.x, [low.x, high.x]);
        push(&mut text, point.y, [low.y, high.y]);
    }
    PackedPoints { from: low.into(), size: (high - low).into(), text }
}

/// Packs numbers between two bounds, two characters each.
#[must_use]
pub fn numbers(values: &[f64], bounds: [f64; 2]) -> String {
    let mut text = String::with_capacity(2 * values.len());
    values.iter().for_each(|value| push(&mut text, *value, bounds));
    text
}

/// Adds a number between two bounds.
fn push(text: &mut String, value: f64, [low, high]: [f64; 2]) {
    let share = if high > low { (value - low) / (high - low) } else { 0.0 };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 4095")]
    let steps = (share.clamp(0.0, 1.0) * f64::from(MOST)).round() as u16;
    for six_bits in [steps >> 6, steps & 63] {
        text.push(char::from(ALPHABET.get(usize::from(six_bits)).copied().unwrap_or(b'A')));
    }
}

/// Returns bytes in base64 (RFC 4648) with its padding.
#[must_use]
pub fn base64(bytes: &[u8]) -> String {
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
        let given = [[1.0, -2.0], [3.0, 2.0], [2.0, 0.0], [f64::NAN, 0.0]].map(Vector2::from);
        let packed = points(&given);
        assert_eq!((packed.from, packed.size), ([1.0, -2.0], [2.0, 4.0]));
        // 0, 4095 and 2048 of 4095 in six bits each.
        assert_eq!(packed.text, "AAAA////gAgA");
        let none = points(&[]);
        assert_eq!((none.from, none.text), ([0.0; 2], String::new()));
    }
}
