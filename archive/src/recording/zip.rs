//! Files in a ZIP archive (PKWARE, APPNOTE 6.3), as far as a KMZ file needs them.

use std::io::{self, Read};

use flate2::{Crc, read::DeflateDecoder};

/// First bytes of an archive, and of the header before each of its files.
pub(super) const ZIP: &[u8] = b"PK\x03\x04";

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
pub(super) fn kml(bytes: &[u8], most: u64) -> io::Result<Option<Vec<u8>>> {
    let Some(entry) = entries(bytes).find(|entry| is_kml(entry.name)) else { return Ok(None) };
    unpacked(bytes, &entry, most).map(Some)
}

fn is_kml(name: &[u8]) -> bool {
    name.get(name.len().saturating_sub(4)..).is_some_and(|end| end.eq_ignore_ascii_case(b".kml"))
}

/// The entries of the directory in its order, as far as they are whole.
fn entries(bytes: &[u8]) -> impl Iterator<Item = Entry<'_>> {
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
        let text = kml(KMZ, 1 << 20).expect("it is whole").expect("a document");
        assert!(text.starts_with(b"<?xml") && text.ends_with(b"</kml>\n"));
        assert_eq!(entries(KMZ).count(), 2);
        assert_eq!(kml(b"PK\x03\x04", 1).expect("no document"), None);
        assert_eq!(kml(b"<kml>", 1).expect("no archive"), None);
    }

    #[test]
    fn damage_is_named_and_never_a_panic() {
        let error = kml(KMZ, 100).expect_err("too long").to_string();
        assert!(error.contains("doc.kml in it holds more than 100 bytes"), "{error}");
        let at = KMZ.windows(7).rposition(|name| name == b"doc.kml").expect("in the directory");
        let mut encrypted = KMZ.to_vec();
        encrypted[at - ENTRY_BYTES + 8] |= 1;
        let error = kml(&encrypted, 1 << 20).expect_err("encrypted").to_string();
        assert!(error.contains("is encrypted"), "{error}");
        let whole = kml(KMZ, 1 << 20).expect("it is whole");
        for index in 0..KMZ.len() {
            let mut damaged = KMZ.to_vec();
            damaged[index] ^= 0x55;
            // Damage is an error, or in what is not looked at.
            if let Ok(Some(text)) = kml(&damaged, 1 << 20) {
                assert_eq!(Some(text), whole, "byte {index}");
            }
            let _ = kml(&KMZ[..index], 1 << 20);
        }
    }
}
