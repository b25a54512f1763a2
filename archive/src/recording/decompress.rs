use std::{
    borrow::Cow,
    io::{self, Read},
};

use flate2::read::MultiGzDecoder;

use super::{RecordingError, content, zip};

/// The first bytes of a gzip file (RFC 1952, §2.3.1).
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Largest decompressed size in bytes: a small file may expand to any size.
const LIMIT_BYTES: u64 = 2 << 30;

/// Contents of a file in UTF-8: the file itself, the text that gzip compressed, or the document
/// of a KMZ file.
pub(super) fn decompressed<'b>(
    bytes: &'b [u8],
    file: &str,
) -> Result<Cow<'b, [u8]>, RecordingError> {
    let wrong = |source| RecordingError::Read { file: file.to_owned(), source };
    if let Some(kml) = zip::kml(bytes, LIMIT_BYTES).map_err(wrong)? {
        return Ok(Cow::Owned(kml));
    }
    if !bytes.starts_with(&GZIP) {
        return Ok(in_utf8(bytes).map_or(Cow::Borrowed(bytes), Cow::Owned));
    }
    let mut held = Vec::new();
    MultiGzDecoder::new(bytes).take(LIMIT_BYTES + 1).read_to_end(&mut held).map_err(wrong)?;
    if held.len() as u64 > LIMIT_BYTES {
        let message = format!("holds more than {LIMIT_BYTES} bytes once it is decompressed");
        return Err(wrong(io::Error::other(message)));
    }
    Ok(Cow::Owned(in_utf8(&held).unwrap_or(held)))
}

/// The first bytes of a file's contents, for one whose begin alone may be given: damage is for the
/// reader to say. A KMZ file must be whole.
pub(super) fn begin(bytes: &[u8], length: usize) -> Cow<'_, [u8]> {
    if bytes.starts_with(&GZIP) {
        let mut held = Vec::new();
        // What came before the end, or before damage, is held.
        let _ = MultiGzDecoder::new(bytes).take(length as u64).read_to_end(&mut held);
        return Cow::Owned(held);
    }
    match zip::kml(bytes, LIMIT_BYTES) {
        Ok(Some(mut kml)) => {
            kml.truncate(length);
            Cow::Owned(kml)
        }
        _ => Cow::Borrowed(bytes.get(..length).unwrap_or(bytes)),
    }
}

/// A text in UTF-16, which begins with a byte order mark, or in Windows-1252, in UTF-8; `None` for
/// any other.
fn in_utf8(bytes: &[u8]) -> Option<Vec<u8>> {
    let (to_unit, text): (fn([u8; 2]) -> u16, _) = match bytes {
        [0xff, 0xfe, text @ ..] => (u16::from_le_bytes, text),
        [0xfe, 0xff, text @ ..] => (u16::from_be_bytes, text),
        _ => return from_windows_1252(bytes),
    };
    let units = text.chunks_exact(2).filter_map(|pair| <[u8; 2]>::try_from(pair).ok());
    let characters = char::decode_utf16(units.map(to_unit));
    let text: String = characters.map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
    Some(text.into_bytes())
}

/// Characters of the bytes 0x80 to 0x9f in Windows-1252 (WHATWG Encoding, index windows-1252).
const WINDOWS_1252: [char; 32] = [
    '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8d}', 'Ž', '\u{8f}',
    '\u{90}', '‘', '’', '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9d}', 'ž', 'Ÿ',
];

/// A text of spreadsheets of the West in UTF-8; `None` for a text in UTF-8 or with control bytes.
/// A text with a single character in UTF-8 beyond ASCII is a text in UTF-8 with a damaged cell.
fn from_windows_1252(bytes: &[u8]) -> Option<Vec<u8>> {
    let is_control = |byte: &u8| *byte < 0x20 && !b"\t\r\n\x0c".contains(byte);
    if std::str::from_utf8(bytes).is_ok() || bytes.iter().any(is_control) {
        return None;
    }
    // The first bytes of a short binary file may all be characters.
    if content::check(bytes, "").is_err() {
        return None;
    }
    if bytes.utf8_chunks().any(|chunk| !chunk.valid().is_ascii()) {
        return None;
    }
    let character = |byte: &u8| {
        let high = byte.checked_sub(0x80).and_then(|at| WINDOWS_1252.get(usize::from(at)));
        high.copied().unwrap_or(char::from(*byte))
    };
    Some(bytes.iter().map(character).collect::<String>().into_bytes())
}
