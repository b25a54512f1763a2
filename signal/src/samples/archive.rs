//! Archives of SigMF (`.sigmf`): tar files (POSIX.1-1988, ustar) with the metadata and the samples
//! of recordings.

use std::io::{self, Read, Seek, SeekFrom};

/// Length of a header, of which a file's contents are a multiple.
const BLOCK: u64 = 512;

/// The most files that are looked at.
const MOST_FILES: usize = 10_000;

/// A file in an archive.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Member {
    pub name: String,
    /// The place of its contents, and their length.
    pub begin: u64,
    pub bytes: u64,
}

/// Returns true for the first bytes of a tar file.
pub(super) fn is_archive(begin: &[u8]) -> bool {
    begin.get(257..262) == Some(b"ustar")
}

/// The files of an archive, without its folders and links.
pub(super) fn members(archive: &mut (impl Read + Seek)) -> io::Result<Vec<Member>> {
    let mut members = Vec::new();
    let mut at = 0;
    // The name of the next file, where it is too long for its header.
    let mut long_name: Option<String> = None;
    while members.len() < MOST_FILES {
        archive.seek(SeekFrom::Start(at))?;
        let mut header = Vec::new();
        archive.by_ref().take(BLOCK).read_to_end(&mut header)?;
        let Some(member) = member(&header, at) else { break };
        let kind = header.get(156).copied().unwrap_or_default();
        let padded = member.bytes.checked_next_multiple_of(BLOCK);
        let Some(next) = padded.and_then(|padded| member.begin.checked_add(padded)) else { break };
        at = next;
        match kind {
            // A file; 0 before POSIX.
            b'0' | 0 => {
                let name = long_name.take().unwrap_or(member.name);
                members.push(Member { name, ..member });
            }
            // GNU's long name, and the records of POSIX.1-2001, of which `path` is one.
            b'L' | b'x' => {
                let mut contents = Vec::new();
                archive.by_ref().take(member.bytes.min(1 << 16)).read_to_end(&mut contents)?;
                let text = String::from_utf8_lossy(&contents).into_owned();
                let name = match kind {
                    b'L' => Some(text.trim_end_matches('\0').to_owned()),
                    _ => {
                        text.lines().find_map(|line| Some(line.split_once(" path=")?.1.to_owned()))
                    }
                };
                long_name = name.or(long_name);
            }
            _ => {}
        }
    }
    Ok(members)
}

/// The file of a header at a place; `None` at the end of an archive.
fn member(header: &[u8], at: u64) -> Option<Member> {
    let text = |bytes: &[u8]| {
        let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
        String::from_utf8_lossy(bytes.get(..end).unwrap_or_default()).into_owned()
    };
    if !is_archive(header) {
        return None;
    }
    let bytes = number(header.get(124..136)?)?;
    Some(Member { name: text(header.get(..100)?), begin: at.checked_add(BLOCK)?, bytes })
}

/// A number in octal digits, or in bytes behind 0x80, as GNU writes 8 GiB and more.
fn number(field: &[u8]) -> Option<u64> {
    if field.first() == Some(&0x80) {
        return field.last_chunk().map(|last| u64::from_be_bytes(*last));
    }
    let text = std::str::from_utf8(field).ok()?;
    u64::from_str_radix(text.trim_matches(['\0', ' ']), 8).ok()
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    /// A file as ustar has it.
    fn file(name: &str, kind: u8, contents: &[u8]) -> Vec<u8> {
        let mut block = vec![0; 512];
        block[..name.len()].copy_from_slice(name.as_bytes());
        let size = format!("{:011o}\0", contents.len());
        block[124..136].copy_from_slice(size.as_bytes());
        block[156] = kind;
        block[257..263].copy_from_slice(b"ustar\0");
        block.extend(contents);
        block.resize(block.len().next_multiple_of(512), 0);
        block
    }

    #[test]
    fn files_are_found_behind_each_other() {
        let long = format!("{}.sigmf-data", "a".repeat(120));
        let bytes = [
            file("rec/", b'5', b""),
            file("rec/a.sigmf-meta", b'0', &[1; 700]),
            file("././@LongLink", b'L', format!("{long}\0").as_bytes()),
            file("aaa", b'0', &[2; 512]),
            file("pax", b'x', b"30 mtime=1782050580.5\n18 path=b.sigmf\n"),
            file("b", 0, b""),
            vec![0; 1024],
        ]
        .concat();
        assert!(is_archive(&bytes));
        let found = members(&mut Cursor::new(&bytes)).expect("in memory");
        let each: Vec<(&str, u64, u64)> =
            found.iter().map(|of| (of.name.as_str(), of.begin, of.bytes)).collect();
        assert_eq!(
            each,
            [("rec/a.sigmf-meta", 1024, 700), (long.as_str(), 3584, 512), ("b.sigmf", 5632, 0)]
        );
        for end in 0..bytes.len() {
            let cut = members(&mut Cursor::new(&bytes[..end])).expect("in memory");
            assert!(cut.len() <= 3);
        }
    }

    #[test]
    fn sizes_beyond_octal_digits_are_read() {
        let mut field = [0; 12];
        field[0] = 0x80;
        field[4..].copy_from_slice(&(9_u64 << 30).to_be_bytes());
        assert_eq!(number(&field), Some(9 << 30));
        assert_eq!(number(b"00000001274\0"), Some(700));
        assert_eq!(number(b"x          \0"), None);
    }
}
