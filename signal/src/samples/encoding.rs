use rustfft::num_complex::Complex32;

use super::SampleFormat;

/// The way in which a file with a header writes its samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Encoding {
    /// As a raw format.
    Plain(SampleFormat),
    /// Unsigned bytes, 128 for zero, as WAV has them.
    Offset8,
    /// Signed words of 24 bits, in three bytes each.
    Packed24,
    /// Signed words of this many bits, in four bytes each.
    Wide(u16),
}

impl Encoding {
    /// Returns the number of bytes in a sample.
    pub(super) const fn bytes(self) -> usize {
        match self {
            Self::Plain(format) => format.bytes(),
            Self::Offset8 => 2,
            Self::Packed24 => 6,
            Self::Wide(_) => 8,
        }
    }

    /// The power of the noise of rounding, as of [`SampleFormat::rounding_noise`].
    pub(super) fn rounding_noise(self) -> f64 {
        let of_bits = |bits: u16| {
            let step = 2f64.powi(1 - i32::from(bits));
            step * step / 6.0
        };
        match self {
            Self::Plain(format) => format.rounding_noise(),
            Self::Offset8 => of_bits(8),
            Self::Packed24 => of_bits(24),
            Self::Wide(bits) => of_bits(bits),
        }
    }

    /// Appends the samples of these bytes; bytes of an incomplete last sample are left out.
    pub(super) fn decode(self, bytes: &[u8], samples: &mut Vec<Complex32>) {
        match self {
            Self::Plain(format) => format.decode(bytes, samples),
            Self::Offset8 => samples.extend(bytes.as_chunks().0.iter().map(|iq: &[u8; 2]| {
                let [i, q] = iq.map(|byte| (f32::from(byte) - 128.0) / 128.0);
                Complex32::new(i, q)
            })),
            Self::Packed24 => {
                samples.extend(bytes.as_chunks().0.iter().map(|[a, b, c, d, e, f]| {
                    // The three bytes are the upper ones of a word.
                    let [i, q] = [[0, *a, *b, *c], [0, *d, *e, *f]].map(i32::from_le_bytes);
                    Complex32::new(scaled(i, 32), scaled(q, 32))
                }));
            }
            Self::Wide(bits) => {
                samples.extend(bytes.as_chunks().0.iter().map(|[a, b, c, d, e, f, g, h]| {
                    let words = [[*a, *b, *c, *d], [*e, *f, *g, *h]].map(i32::from_le_bytes);
                    let [i, q] = words.map(|word| scaled(word, bits));
                    Complex32::new(i, q)
                }));
            }
        }
    }
}

/// A word over the full scale of its bits.
#[expect(clippy::cast_precision_loss, reason = "receivers have at most 24 bits")]
fn scaled(word: i32, bits: u16) -> f32 {
    word as f32 * 2f32.powi(1 - i32::from(bits))
}
