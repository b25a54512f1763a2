use std::{
    borrow::Cow,
    io::{self, Read},
};

use flate2::read::MultiGzDecoder;

use super::RecordingError;

/// The first bytes of a gzip file (RFC 1952, §2.3.1).
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// No recording is larger than this: a small file may hold any amount of nothing.
const LIMIT_BYTES: u64 = 2 << 30;

/// What a file holds: the file itself, or what was compressed with gzip.
pub(super) fn decompressed<'b>(
    bytes: &'b [u8],
    file: &str,
) -> Result<Cow<'b, [u8]>, RecordingError> {
    if !bytes.starts_with(&GZIP) {
        return Ok(Cow::Borrowed(bytes));
    }
    let wrong = |source| RecordingError::Read { file: file.to_owned(), source };
    let mut held = Vec::new();
    MultiGzDecoder::new(bytes).take(LIMIT_BYTES + 1).read_to_end(&mut held).map_err(wrong)?;
    if held.len() as u64 > LIMIT_BYTES {
        let message = format!("holds more than {LIMIT_BYTES} bytes once it is decompressed");
        return Err(wrong(io::Error::other(message)));
    }
    Ok(Cow::Owned(held))
}
