//! Files of SDRangel (`.sdriq`): a header of 32 bytes, then words of 16 bits or of 24 in 32
//! (f4exb/sdrangel, `sdrbase/dsp/filerecord.h`).

use flate2::Crc;

use super::{SampleFormat, encoding::Encoding};

/// Length of the header; its last four bytes are the CRC-32 of those before.
pub(super) const HEADER_BYTES: usize = 32;

/// A header.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sdriq {
    pub encoding: Encoding,
    pub rate_hz: f64,
    pub center_hz: f64,
}

/// Reads the first bytes of a file; `None` if their checksum does not match, so that they are no
/// such header, or for another size of samples.
pub(super) fn header(begin: &[u8]) -> Option<Sdriq> {
    let header = begin.first_chunk::<HEADER_BYTES>()?;
    let (fields, crc) = header.split_last_chunk::<4>()?;
    let mut sum = Crc::new();
    sum.update(fields);
    if sum.sum() != u32::from_le_bytes(*crc) {
        return None;
    }
    let rate = u32::from_le_bytes(*header.first_chunk()?);
    let center = u64::from_le_bytes(header.get(4..12)?.try_into().ok()?);
    let bits = u32::from_le_bytes(header.get(20..24)?.try_into().ok()?);
    let encoding = match bits {
        16 => Encoding::Plain(SampleFormat::Cs16),
        24 => Encoding::Wide(24),
        _ => return None,
    };
    #[expect(clippy::cast_precision_loss, reason = "frequencies are far below 2^53")]
    let center_hz = center as f64;
    Some(Sdriq { encoding, rate_hz: f64::from(rate), center_hz })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    /// By Python's `struct` and `zlib.crc32`: 48 kS/s about 150.1 MHz, 24 bits.
    const HEADER: [u8; 32] = [
        0x80, 0xbb, 0x00, 0x00, 0x20, 0x58, 0xf2, 0x08, 0x00, 0x00, 0x00, 0x00, 0x20, 0xe6, 0x7d,
        0xea, 0x9e, 0x01, 0x00, 0x00, 0x18, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x12, 0x13,
        0x9c, 0x19,
    ];

    #[test]
    fn a_header_is_known_by_its_checksum() {
        let read = header(&HEADER).expect("a header");
        assert_eq!((read.encoding, read.rate_hz), (Encoding::Wide(24), 48_000.0));
        assert_abs_diff_eq!(read.center_hz, 150.1e6, epsilon = 1e-6);
        for index in 0..HEADER.len() {
            let mut damaged = HEADER;
            damaged[index] ^= 1;
            assert_eq!(header(&damaged), None, "byte {index}");
            assert_eq!(header(&HEADER[..index]), None);
        }
    }
}
