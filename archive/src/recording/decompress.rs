//! Bytes of a recording: decompressed, out of a KMZ file, and as text; files of known other kinds
//! are refused.
//!
//! Archives are those of PKWARE (APPNOTE 6.3), as far as a KMZ file needs them.

use std::{
    borrow::Cow,
    io::{self, Read},
};

use flate2::{
    Crc,
    read::{DeflateDecoder, MultiGzDecoder},
};
use foxhunt_hunt::log::LOG_BEGIN;

use super::{RecordingError, flight_log::Kind};

/// Bytes in which a byte of zero is looked for.
const LOOKED_AT: usize = 4096;

/// Contents that are no table, by their first bytes: the name, and the command that would work,
/// in which `{}` is the file.
const CONTENTS: [(&[u8], &str, &str); 15] = [
    (b"SQLite format 3\0", "an SQLite database", BAG),
    (b"\x89MCAP", "a bag of ROS 2", BAG),
    (b"PK\x03\x04", "a spreadsheet or another ZIP archive", SPREADSHEET),
    (b"\xd0\xcf\x11\xe0", "a spreadsheet of Excel 97", SPREADSHEET),
    (b"RIFF", "a file of samples", SAMPLES),
    (b"RF64", "a file of samples", SAMPLES),
    (b"BW64", "a file of samples", SAMPLES),
    (b"riff\x2e\x91\xcf\x11", "a file of samples", SAMPLES),
    (b"<?xml", "an XML file", TRACK),
    (b"<gpx", "a GPX track", TRACK),
    (b"<kml", "a KML file", TRACK),
    (b"%PDF", "a PDF document", NOTHING),
    (LOG_BEGIN, "the log of a hunt", LOG),
    (b"\x89PNG", "a picture", NOTHING),
    (b"\xff\xd8\xff", "a picture", NOTHING),
];

const BAG: &str = "a bag of ROS 2 becomes a table with: foxhunt convert {} OUT.csv";
#[cfg(feature = "spreadsheets")]
const SPREADSHEET: &str = "save its sheet as CSV, then: foxhunt locate FILE.csv";
#[cfg(not(feature = "spreadsheets"))]
const SPREADSHEET: &str = "a build with the feature `spreadsheets` reads .xlsx, .xls and .ods; or \
                           save the sheet as CSV, then: foxhunt locate FILE.csv";
const SAMPLES: &str = "it becomes a table of pulses with: foxhunt pulses {} --csv";
const TRACK: &str = "a path alone locates nothing; give it beside a table of levels with their \
                     times: foxhunt locate {} LEVELS.csv";
const LOG: &str = "its receptions are located again with: foxhunt replay {}";
const NOTHING: &str = "a recording is a CSV file whose first line names the columns";

/// Refuses a file that is no text, and names what it is.
pub(super) fn check_content(bytes: &[u8], file: &str) -> Result<(), RecordingError> {
    let known = CONTENTS.iter().find(|(magic, ..)| bytes.starts_with(magic));
    let log = Kind::of(bytes).map(|kind| (kind.name(), TRACK));
    let known = known.map(|(_, what, advice)| (*what, *advice)).or(log);
    // The first element stands behind the declaration of XML.
    let begin = bytes.get(..LOOKED_AT).unwrap_or(bytes);
    let has = |element: &[u8]| begin.windows(element.len()).any(|word| word == element);
    let known = known.map(|(what, advice)| match what {
        "an XML file" if has(b"<kml") => ("a KML file", advice),
        "an XML file" if has(b"<gpx") => ("a GPX track", advice),
        what => (what, advice),
    });
    let (what, advice) = match known {
        Some(known) => known,
        None if bytes.iter().take(LOOKED_AT).any(|byte| *byte == 0) => ("a binary file", NOTHING),
        None => return Ok(()),
    };
    let file = file.to_owned();
    Err(RecordingError::NotATable { what, advice: advice.replace("{}", &file), file })
}

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
    if let Some(kml) = zipped_kml(bytes, LIMIT_BYTES).map_err(wrong)? {
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
    match zipped_kml(bytes, LIMIT_BYTES) {
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
    if check_content(bytes, "").is_err() {
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

/// First bytes of an archive, and of the header before each of its files.
const ZIP: &[u8] = b"PK\x03\x04";

/// First bytes of a file's entry in the directory.
const ENTRY: &[u8] = b"PK\x01\x02";

/// First bytes of the record at the end, and its length without a comment.
const END: &[u8] = b"PK\x05\x06";
const END_BYTES: usize = 22;

/// Longest comment at the end of an archive.
const MOST_COMMENT: usize = 0xffff;

/// Length of an entry of the directory, and of the header before a file, without their names.
const ENTRY_BYTES: usize = 46;
const HEADER_BYTES: usize = 30;

/// The flag of a file that is encrypted.
const ENCRYPTED: u16 = 1;

/// A file of an archive, as the directory has it.
struct Entry<'z> {
    name: &'z [u8],
    flags: u16,
    method: u16,
    crc: u32,
    packed: usize,
    size: u64,
    header: usize,
    /// The begin of the next entry.
    next: usize,
}

/// Returns the contents of the first KML document, which is the root of a KMZ file (OGC 12-007r2,
/// annex C); `None` for an archive without one, and for any other file.
///
/// # Errors
///
/// Names the reason why the document cannot be unpacked: encryption, another compression than
/// deflate, more than `most` bytes, or damage.
fn zipped_kml(bytes: &[u8], most: u64) -> io::Result<Option<Vec<u8>>> {
    let Some(entry) = zip_entries(bytes).find(|entry| is_kml(entry.name)) else { return Ok(None) };
    unpacked(bytes, &entry, most).map(Some)
}

fn is_kml(name: &[u8]) -> bool {
    name.get(name.len().saturating_sub(4)..).is_some_and(|end| end.eq_ignore_ascii_case(b".kml"))
}

/// The entries of the directory in its order, as far as they are whole.
fn zip_entries(bytes: &[u8]) -> impl Iterator<Item = Entry<'_>> {
    let mut next = directory(bytes);
    std::iter::from_fn(move || {
        let entry = entry(bytes, next?)?;
        next = Some(entry.next);
        Some(entry)
    })
}

/// The begin of the directory.
fn directory(bytes: &[u8]) -> Option<usize> {
    if !bytes.starts_with(ZIP) {
        return None;
    }
    let from = bytes.len().saturating_sub(END_BYTES + MOST_COMMENT);
    let last = bytes.get(from..)?.windows(END.len()).rposition(|four| four == END)?;
    usize::try_from(four(bytes, from + last + 16)?).ok()
}

fn entry(bytes: &[u8], at: usize) -> Option<Entry<'_>> {
    let fixed = bytes.get(at..at.checked_add(ENTRY_BYTES)?)?;
    if !fixed.starts_with(ENTRY) {
        return None;
    }
    let length = |at| two(fixed, at).map(usize::from);
    let begin = at + ENTRY_BYTES;
    let end = begin + length(28)?;
    Some(Entry {
        name: bytes.get(begin..end)?,
        flags: two(fixed, 8)?,
        method: two(fixed, 10)?,
        crc: four(fixed, 16)?,
        packed: usize::try_from(four(fixed, 20)?).ok()?,
        size: u64::from(four(fixed, 24)?),
        header: usize::try_from(four(fixed, 42)?).ok()?,
        next: end + length(30)? + length(32)?,
    })
}

fn unpacked(bytes: &[u8], entry: &Entry<'_>, most: u64) -> io::Result<Vec<u8>> {
    let wrong = |reason: &str| {
        let name = String::from_utf8_lossy(entry.name);
        io::Error::other(format!("{name} in it {reason}"))
    };
    if entry.flags & ENCRYPTED != 0 {
        return Err(wrong("is encrypted"));
    }
    let packed = packed(bytes, entry).ok_or_else(|| wrong("is cut off"))?;
    let mut contents = Vec::new();
    match entry.method {
        0 => contents.extend_from_slice(packed),
        8 => {
            let read = DeflateDecoder::new(packed).take(most + 1).read_to_end(&mut contents);
            read.map_err(|_| wrong("is damaged"))?;
        }
        _ => return Err(wrong("is compressed by another method than deflate")),
    }
    if contents.len() as u64 > most {
        return Err(wrong(&format!("holds more than {most} bytes")));
    }
    let mut crc = Crc::new();
    crc.update(&contents);
    if contents.len() as u64 != entry.size || crc.sum() != entry.crc {
        return Err(wrong("is damaged"));
    }
    Ok(contents)
}

/// The bytes of a file behind the header before it.
fn packed<'z>(bytes: &'z [u8], entry: &Entry<'_>) -> Option<&'z [u8]> {
    let end = entry.header.checked_add(HEADER_BYTES)?;
    let header = bytes.get(entry.header..end)?;
    let length = |at| two(header, at).map(usize::from);
    let begin = end + length(26)? + length(28)?;
    bytes.get(begin..begin.checked_add(entry.packed)?).filter(|_| header.starts_with(ZIP))
}

fn two(bytes: &[u8], at: usize) -> Option<u16> {
    bytes.get(at..at.checked_add(2)?)?.try_into().ok().map(u16::from_le_bytes)
}

fn four(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..at.checked_add(4)?)?.try_into().ok().map(u32::from_le_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By Python's `zipfile`: `files/a.png`, stored, and `doc.kml`, deflated.
    const KMZ: &[u8] = include_bytes!("../../tests/data/shapes/walk.kmz");

    #[test]
    fn the_first_document_is_unpacked() {
        let text = zipped_kml(KMZ, 1 << 20).expect("it is whole").expect("a document");
        assert!(text.starts_with(b"<?xml") && text.ends_with(b"</kml>\n"));
        assert_eq!(zip_entries(KMZ).count(), 2);
        assert_eq!(zipped_kml(b"PK\x03\x04", 1).expect("no document"), None);
        assert_eq!(zipped_kml(b"<kml>", 1).expect("no archive"), None);
    }

    #[test]
    fn damage_is_named_and_never_a_panic() {
        let error = zipped_kml(KMZ, 100).expect_err("too long").to_string();
        assert!(error.contains("doc.kml in it holds more than 100 bytes"), "{error}");
        let at = KMZ.windows(7).rposition(|name| name == b"doc.kml").expect("in the directory");
        let mut encrypted = KMZ.to_vec();
        encrypted[at - ENTRY_BYTES + 8] |= 1;
        let error = zipped_kml(&encrypted, 1 << 20).expect_err("encrypted").to_string();
        assert!(error.contains("is encrypted"), "{error}");
        let whole = zipped_kml(KMZ, 1 << 20).expect("it is whole");
        for index in 0..KMZ.len() {
            let mut damaged = KMZ.to_vec();
            damaged[index] ^= 0x55;
            // Damage is an error, or in what is not looked at.
            if let Ok(Some(text)) = zipped_kml(&damaged, 1 << 20) {
                assert_eq!(Some(text), whole, "byte {index}");
            }
            let _ = zipped_kml(&KMZ[..index], 1 << 20);
        }
    }
}
