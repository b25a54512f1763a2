/// The longest answer that is taken: head and body.
const LONGEST: usize = 1 << 18;

/// An answer of an HTTP server to one question on a connection of its own.
#[derive(Clone, Debug, Default)]
pub struct HttpResponse {
    bytes: Vec<u8>,
}

/// Reason for refusing an answer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum HttpError {
    /// It is longer than any that is expected.
    #[error("the server's answer has more than {LONGEST} bytes")]
    TooLong,
    /// It is no HTTP.
    #[error("the server's answer begins with {line:?}, which is no HTTP")]
    NoHttp {
        /// Its first line.
        line: String,
    },
    /// The server refuses.
    #[error("the server answers {status}")]
    Status {
        /// Its number, such as 404.
        status: u16,
    },
    /// It ended before it was complete.
    #[error("the server's answer was cut after {bytes} bytes")]
    Cut {
        /// Number of bytes received.
        bytes: usize,
    },
}

/// A body's declared length, and its bytes so far.
struct Body<'a> {
    length: Option<usize>,
    bytes: &'a [u8],
}

impl HttpResponse {
    /// The question for a page of a host, after whose answer the server closes the connection.
    #[must_use]
    pub fn request(host: &str, path: &str) -> Vec<u8> {
        format!("GET {path} HTTP/1.0\r\nHost: {host}\r\nConnection: close\r\n\r\n").into_bytes()
    }

    /// Takes received bytes; returns the body, once it is as long as declared.
    ///
    /// # Errors
    ///
    /// [`HttpError`] names what is wrong with it.
    pub fn push(&mut self, bytes: &[u8]) -> Result<Option<Vec<u8>>, HttpError> {
        if self.bytes.len() + bytes.len() > LONGEST {
            return Err(HttpError::TooLong);
        }
        self.bytes.extend(bytes);
        let Some(Body { length, bytes }) = self.parts()? else { return Ok(None) };
        Ok(length.and_then(|length| bytes.get(..length)).map(<[u8]>::to_vec))
    }

    /// The server has closed the connection; the body.
    ///
    /// # Errors
    ///
    /// [`HttpError`] names what is wrong with it.
    pub fn end(self) -> Result<Vec<u8>, HttpError> {
        let cut = HttpError::Cut { bytes: self.bytes.len() };
        match self.parts()? {
            Some(Body { length: Some(length), bytes }) => {
                bytes.get(..length).map(<[u8]>::to_vec).ok_or(cut)
            }
            Some(Body { length: None, bytes }) => Ok(bytes.to_vec()),
            None => Err(cut),
        }
    }

    /// The body so far; `None` before the head is complete.
    fn parts(&self) -> Result<Option<Body<'_>>, HttpError> {
        let first = self.bytes.split(|byte| *byte == b'\n').next().unwrap_or_default();
        let begins = first.get(..5).map_or(b"HTTP/".starts_with(first), |word| word == b"HTTP/");
        let line = String::from_utf8_lossy(first.get(..80).unwrap_or(first)).trim().to_owned();
        if !begins {
            return Err(HttpError::NoHttp { line });
        }
        let end = self.bytes.windows(4).position(|four| four == b"\r\n\r\n");
        let Some((head, body)) = end.and_then(|end| self.bytes.split_at_checked(end)) else {
            return Ok(None);
        };
        let status = line.split_whitespace().nth(1).and_then(|number| number.parse().ok());
        match status {
            Some(200) => {}
            Some(status) => return Err(HttpError::Status { status }),
            None => return Err(HttpError::NoHttp { line }),
        }
        let head = String::from_utf8_lossy(head);
        let length = head.lines().find_map(|line| {
            let (name, value) = line.split_once(':')?;
            name.eq_ignore_ascii_case("content-length").then(|| value.trim().parse().ok())?
        });
        Ok(Some(Body { length, bytes: body.get(4..).unwrap_or_default() }))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn bodies_end_with_their_length_or_the_connection() {
        let mut response = HttpResponse::default();
        assert_eq!(response.push(b"HT"), Ok(None));
        assert_eq!(response.push(b"TP/1.1 200 OK\r\ncontent-length: 4\r\n\r\nab"), Ok(None));
        assert_eq!(response.clone().end(), Err(HttpError::Cut { bytes: 40 }));
        assert_eq!(response.push(b"cdef"), Ok(Some(b"abcd".to_vec())));
        let mut response = HttpResponse::default();
        assert_eq!(response.push(b"HTTP/1.0 200 OK\r\n\r\nabc"), Ok(None));
        assert_eq!(response.end(), Ok(b"abc".to_vec()));
        let mut response = HttpResponse::default();
        let missing = response.push(b"HTTP/1.0 404 Not Found\r\n\r\n");
        assert_eq!(missing, Err(HttpError::Status { status: 404 }));
        assert!(matches!(HttpResponse::default().push(b"RTL0\n"), Err(HttpError::NoHttp { .. })));
        let long = HttpResponse::default().push(&vec![0; LONGEST + 1]);
        assert_eq!(long, Err(HttpError::TooLong));
    }

    proptest! {
        #[test]
        fn nothing_breaks_it(bytes: Vec<u8>, ok: bool) {
            let mut response = HttpResponse::default();
            if ok {
                response.push(b"HTTP/1.0 200 OK\r\n").expect("it is in order");
            }
            let _ = response.push(&bytes);
            let _ = response.end();
        }
    }
}
