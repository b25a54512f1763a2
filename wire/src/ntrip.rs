//! NTRIP 1 and 2 (RTCM 10410): the request to a caster, the head of its answer, and the chunks of
//! its stream.

use std::fmt::Write as _;

/// The longest head of an answer that is read, in bytes.
const LONGEST_HEAD: usize = 4096;

/// The longest line of a chunk's length, in bytes.
const LONGEST_LENGTH: usize = 64;

/// Version of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// Version 1, with the answer `ICY 200 OK`.
    One,
    /// HTTP 1.1.
    Two,
}

/// Request for the stream of a mountpoint.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Version of the protocol.
    pub version: Version,
    /// Host and port of the caster.
    pub host: &'a str,
    /// Name of the stream.
    pub mountpoint: &'a str,
    /// User and password.
    pub credentials: Option<(&'a str, &'a str)>,
}

impl Request<'_> {
    /// Text of the request, which is to be checked for line ends by its caller.
    #[must_use]
    pub fn text(&self) -> String {
        let agent = concat!("User-Agent: NTRIP foxhunt/", env!("CARGO_PKG_VERSION"), "\r\n");
        let mut text = match self.version {
            Version::One => format!("GET /{} HTTP/1.0\r\n{agent}", self.mountpoint),
            Version::Two => format!(
                "GET /{} HTTP/1.1\r\nHost: {}\r\nNtrip-Version: Ntrip/2.0\r\n{agent}Connection: \
                 close\r\n",
                self.mountpoint, self.host
            ),
        };
        if let Some((user, password)) = self.credentials {
            // Writing to a text cannot fail.
            let _ = write!(text, "Authorization: Basic {}\r\n", basic(user, password));
        }
        text + "\r\n"
    }
}

/// User and password as HTTP's basic authentication has them (RFC 7617): base 64 of both.
#[must_use]
pub fn basic(user: &str, password: &str) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let digit = |bits: u32| char::from(DIGITS.get(bits as usize & 63).copied().unwrap_or(b'='));
    let bytes = format!("{user}:{password}").into_bytes();
    let quartet = |triple: &[u8]| {
        let byte = |at: usize| u32::from(triple.get(at).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        let digits = [digit(bits >> 18), digit(bits >> 12), digit(bits >> 6), digit(bits)];
        let used = digits.into_iter().take(triple.len() + 1);
        used.chain(std::iter::repeat('=')).take(4).collect::<String>()
    };
    bytes.chunks(3).map(quartet).collect()
}

/// Answer of a caster to a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The stream follows.
    Stream {
        /// True if it comes in chunks of HTTP.
        chunked: bool,
    },
    /// The list of streams follows: no stream has the requested name.
    SourceTable,
    /// User or password are wrong or missing.
    Unauthorised,
    /// There is no stream of the requested name.
    NotFound,
    /// Another refusal, or no answer of a caster: the first line.
    Other(String),
}

/// Reads the head of an answer. Returns it with the number of its bytes; `None` while more is
/// needed.
#[must_use]
pub fn answer(bytes: &[u8]) -> Option<(Answer, usize)> {
    let Some(end) = bytes.windows(2).position(|pair| pair == b"\r\n") else {
        let is_short = bytes.len() < LONGEST_HEAD;
        return if is_short { None } else { Some((Answer::Other(line(bytes)), bytes.len())) };
    };
    let first = line(bytes.get(..end).unwrap_or_default());
    let mut words = first.split_whitespace();
    let protocol = words.next().unwrap_or_default();
    let code = words.next().unwrap_or_default();
    let after_line = end + 2;
    match (protocol, code) {
        ("ICY", "200") => return Some((Answer::Stream { chunked: false }, after_line)),
        ("SOURCETABLE", _) => return Some((Answer::SourceTable, after_line)),
        ("ERROR", _) if first.to_ascii_lowercase().contains("password") => {
            return Some((Answer::Unauthorised, after_line));
        }
        _ if !protocol.starts_with("HTTP/") => return Some((Answer::Other(first), after_line)),
        (_, "401" | "403") => return Some((Answer::Unauthorised, after_line)),
        (_, "404") => return Some((Answer::NotFound, after_line)),
        (_, "200") => {}
        _ => return Some((Answer::Other(first), after_line)),
    }
    let Some(head) = bytes.windows(4).position(|four| four == b"\r\n\r\n") else {
        let is_short = bytes.len() < LONGEST_HEAD;
        return if is_short { None } else { Some((Answer::Other(first), bytes.len())) };
    };
    let fields = String::from_utf8_lossy(bytes.get(after_line..head).unwrap_or_default())
        .to_ascii_lowercase();
    let has = |name: &str, value: &str| {
        let of =
            |line: &str| line.split_once(':').is_some_and(|(n, v)| n == name && v.contains(value));
        fields.lines().any(of)
    };
    let answer = match has("content-type", "sourcetable") {
        true => Answer::SourceTable,
        false => Answer::Stream { chunked: has("transfer-encoding", "chunked") },
    };
    Some((answer, head + 4))
}

/// A first line that may be shown: at most 80 characters, no control characters.
fn line(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).chars().filter(|c| !c.is_control()).take(80).collect()
}

/// Content of a stream in chunks of HTTP 1.1 (RFC 9112, 7.1).
#[derive(Clone, Debug, Default)]
pub struct Chunks {
    /// Bytes of this chunk and its line end that are still to come.
    left: usize,
    /// Line of the next chunk's length.
    length: Vec<u8>,
}

/// Error of a stream that is not in chunks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the caster's stream is not in chunks, as its answer says")]
pub struct NotInChunks;

impl Chunks {
    /// Takes bytes; hands on the content in them.
    ///
    /// # Errors
    ///
    /// [`NotInChunks`] if a length is not a hexadecimal number.
    pub fn take(
        &mut self,
        mut bytes: &[u8],
        emit: &mut dyn FnMut(&[u8]),
    ) -> Result<(), NotInChunks> {
        while let [first, rest @ ..] = bytes {
            if self.left > 0 {
                let content = bytes.len().min(self.left.saturating_sub(2));
                let (piece, after) = bytes.split_at_checked(content).unwrap_or((bytes, &[]));
                if content > 0 {
                    emit(piece);
                    self.left -= content;
                    bytes = after;
                } else {
                    // A byte of the line end behind the chunk.
                    self.left -= 1;
                    bytes = rest;
                }
                continue;
            }
            bytes = rest;
            if *first != b'\n' {
                self.length.push(*first);
                if self.length.len() > LONGEST_LENGTH {
                    return Err(NotInChunks);
                }
                continue;
            }
            let line = std::mem::take(&mut self.length);
            let text = str::from_utf8(&line).map_err(|_| NotInChunks)?;
            let digits = text.split(';').next().unwrap_or_default().trim();
            let length = usize::from_str_radix(digits, 16).map_err(|_| NotInChunks)?;
            self.left = length.checked_add(2).ok_or(NotInChunks)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn credentials_are_those_of_the_rfc() {
        // RFC 7617, section 2.
        assert_eq!(basic("Aladdin", "open sesame"), "QWxhZGRpbjpvcGVuIHNlc2FtZQ==");
        assert_eq!(basic("a", "b"), "YTpi");
        assert_eq!(basic("a", ""), "YTo=");
    }

    #[test]
    fn requests_name_their_version() {
        let request = Request {
            version: Version::One,
            host: "caster:2101",
            mountpoint: "NEAR",
            credentials: None,
        };
        let text = request.text();
        assert!(text.starts_with("GET /NEAR HTTP/1.0\r\nUser-Agent: NTRIP "), "{text}");
        let credentials = Some(("Aladdin", "open sesame"));
        let text = Request { version: Version::Two, credentials, ..request }.text();
        for line in [
            "GET /NEAR HTTP/1.1",
            "Host: caster:2101",
            "Ntrip-Version: Ntrip/2.0",
            "Authorization: Basic QWxhZGRpbjpvcGVuIHNlc2FtZQ==",
        ] {
            assert!(text.lines().any(|own| own == line), "{line}: {text}");
        }
        assert!(text.ends_with("\r\n\r\n"));
    }

    #[test]
    fn answers_are_streams_or_refusals() {
        let http = |status: &str, fields: &str| format!("HTTP/1.1 {status}\r\n{fields}\r\n");
        let chunked = "Content-Type: gnss/data\r\nTransfer-Encoding: chunked\r\n";
        for (text, expected) in [
            ("ICY 200 OK\r\n".to_owned(), Answer::Stream { chunked: false }),
            (http("200 OK", chunked), Answer::Stream { chunked: true }),
            (http("200 OK", "Content-Type: gnss/data\r\n"), Answer::Stream { chunked: false }),
            (http("200 OK", "Content-Type: gnss/sourcetable\r\n"), Answer::SourceTable),
            ("SOURCETABLE 200 OK\r\n".into(), Answer::SourceTable),
            ("ERROR - Bad Password\r\n".into(), Answer::Unauthorised),
            ("HTTP/1.0 401 Unauthorized\r\n".into(), Answer::Unauthorised),
            ("HTTP/1.1 404 Not Found\r\n".into(), Answer::NotFound),
            ("SSH-2.0-OpenSSH_9.2\r\n".into(), Answer::Other("SSH-2.0-OpenSSH_9.2".into())),
            ("HTTP/1.1 503 Busy\r\n".into(), Answer::Other("HTTP/1.1 503 Busy".into())),
        ] {
            let stream = format!("{text}\u{7}rest");
            assert_eq!(answer(stream.as_bytes()), Some((expected, text.len())), "{text}");
            let begun = text.len() - 2;
            assert_eq!(answer(&stream.as_bytes()[..begun]), None, "{text} less its end");
        }
        let endless = answer(&[b'x'; 5000]);
        assert!(matches!(endless, Some((Answer::Other(_), 5000))), "{endless:?}");
    }

    #[test]
    fn chunks_are_joined_however_they_are_cut() {
        let stream = b"3\r\nabc\r\n0a;name=1\r\n0123456789\r\n1\r\n\n\r\n";
        for cut in 1..stream.len() {
            let mut chunks = Chunks::default();
            let mut content: Vec<u8> = Vec::new();
            for piece in stream.chunks(cut) {
                let taken = chunks.take(piece, &mut |bytes| content.extend(bytes));
                assert_eq!(taken, Ok(()));
            }
            assert_eq!(content, b"abc0123456789\n", "cut {cut}");
        }
        assert_eq!(Chunks::default().take(b"\xd3\x00\x13\n", &mut |_| ()), Err(NotInChunks));
        assert_eq!(Chunks::default().take(&[b'1'; 99], &mut |_| ()), Err(NotInChunks));
    }
}
