//! Values in bytes of seven bits, the lowest first.

use std::str::Utf8Chunk;

use super::FirmataError;

/// The largest magnitude that has room beside the sign.
const LARGEST: u32 = 0x7FFF_FFFF;

/// A whole number: its magnitude, and its sign in bit 3 of the last byte.
pub(super) fn encode_i32(field: &'static str, value: i32) -> Result<[u8; 5], FirmataError> {
    let magnitude = value.unsigned_abs();
    if magnitude > LARGEST {
        let most = i64::from(LARGEST);
        return Err(FirmataError { field, value: value.into(), least: -most, most });
    }
    let mut bytes = [0, 7, 14, 21, 28].map(|bit| low(magnitude >> bit));
    bytes[4] |= u8::from(value < 0) << 3;
    Ok(bytes)
}

/// `None` where bits are set that have no meaning.
pub(super) fn decode_i32([a, b, c, d, last]: [u8; 5]) -> Option<i32> {
    if last > 0x0F {
        return None;
    }
    let magnitude = u32::from(a)
        | u32::from(b) << 7
        | u32::from(c) << 14
        | u32::from(d) << 21
        | u32::from(last & 0x07) << 28;
    let magnitude = i32::try_from(magnitude).ok()?;
    Some(if last & 0x08 == 0 { magnitude } else { -magnitude })
}

/// Every byte as two.
pub(super) fn encode_text(text: &str, into: &mut Vec<u8>) {
    into.extend(text.bytes().flat_map(|byte| [byte & 0x7F, byte >> 7]));
}

/// `None` where half a byte is missing, or more than a byte is there. A byte that is no UTF-8
/// becomes a question mark: a text does not grow on the way, so what was read fits into a message
/// again.
pub(super) fn decode_text(bytes: &[u8]) -> Option<String> {
    let (pairs, rest) = bytes.as_chunks::<2>();
    let byte = |[low, high]: &[u8; 2]| (*high < 2).then(|| low | high << 7);
    let text: Vec<u8> = pairs.iter().map(byte).collect::<Option<_>>()?;
    let readable =
        |chunk: Utf8Chunk<'_>| format!("{}{}", chunk.valid(), "?".repeat(chunk.invalid().len()));
    rest.is_empty().then(|| text.utf8_chunks().map(readable).collect())
}

fn low(bits: u32) -> u8 {
    u8::try_from(bits & 0x7F).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_one_number_without_room_is_refused() {
        let refused = encode_i32("steps", i32::MIN).expect_err("no room").to_string();
        assert!(refused.contains("steps is -2147483648"), "{refused}");
        assert_eq!(decode_i32([0, 0, 0, 0, 0x10]), None);
        assert_eq!(decode_i32([0, 0, 0, 0, 0x08]), Some(0), "minus nothing");
    }

    #[test]
    fn a_text_that_is_no_utf_8_keeps_its_length() {
        let bytes: Vec<u8> =
            b"a\xE9\xFFz".iter().flat_map(|byte| [byte & 0x7F, byte >> 7]).collect();
        assert_eq!(decode_text(&bytes).as_deref(), Some("a??z"));
    }

    proptest! {
        #[test]
        fn whole_numbers_and_back(value in -i32::MAX..=i32::MAX) {
            let bytes = encode_i32("value", value).expect("it has room");
            prop_assert!(bytes.iter().all(|byte| *byte < 0x80));
            prop_assert_eq!(decode_i32(bytes), Some(value));
        }

        #[test]
        fn texts_and_back(text in "\\PC*") {
            let mut bytes = Vec::new();
            encode_text(&text, &mut bytes);
            prop_assert!(bytes.iter().all(|byte| *byte < 0x80));
            prop_assert_eq!(decode_text(&bytes), Some(text));
        }
    }
}
