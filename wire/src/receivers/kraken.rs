//! A `KrakenSDR`'s page of bearings, and the HTTP response that it comes in.

use core::f64::consts::TAU;

/// Number of fields of a line.
const FIELDS: usize = 377;

/// Number of fields of the pseudo-spectrum, and of the fields before it.
const BINS: usize = 360;
const BEFORE: usize = FIELDS - BINS;

/// Maximum number of lines of a page: a `KrakenSDR` has at most 16 channels.
const LINES: usize = 16;

/// Numbers are smaller than this; a frequency in Hz is the largest.
const LARGEST: f64 = 1e12;

/// The longest answer that is taken: head and body.
const LONGEST: usize = 1 << 18;

/// A line of `KrakenSDR`'s page `DOA_value.html`: the directions from which one channel is
/// received.
#[derive(Clone, Debug, PartialEq)]
pub struct KrakenDoa {
    /// The time in milliseconds of UNIX time, by its clock.
    pub unix_ms: u64,
    /// Confidence of the `KrakenSDR` in the direction, from 0 to 99.
    pub confidence: f64,
    /// The power, in dB over its full scale.
    pub power_db: f64,
    /// The channel's frequency in Hz.
    pub frequency_hz: f64,
    /// Likelihood of each of 360 directions, in dB below the likeliest; `i` is `i` degrees
    /// counter-clockwise of the array's front.
    pub spectrum_db: Vec<f64>,
}

/// Reason for refusing a line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum KrakenError {
    /// It was read while it was written, or is something else.
    #[error("a line of KrakenSDR has {FIELDS} fields; this one has {fields}")]
    Fields {
        /// Number of its fields.
        fields: usize,
    },
    /// A field is no number.
    #[error("field {field} of a line of KrakenSDR is {text:?}, which is not a number")]
    Number {
        /// Number of the field, from 1.
        field: usize,
        /// Text of the field.
        text: String,
    },
}

impl KrakenDoa {
    /// The lines of a page; tags around them are left out.
    #[must_use]
    pub fn page(text: &str) -> Vec<Result<Self, KrakenError>> {
        let lines = text.lines().map(|line| {
            let line = line.trim();
            let line = line.rsplit_once("<html>").map_or(line, |(_, rest)| rest);
            line.split('<').next().unwrap_or_default().trim()
        });
        lines.filter(|line| !line.is_empty()).take(LINES).map(Self::line).collect()
    }

    /// The line that this text is.
    ///
    /// # Errors
    ///
    /// [`KrakenError`] names what is wrong with it.
    pub fn line(text: &str) -> Result<Self, KrakenError> {
        let texts: Vec<&str> = text.split(',').map(str::trim).take(FIELDS + 1).collect();
        if texts.len() != FIELDS {
            return Err(KrakenError::Fields { fields: text.split(',').count() });
        }
        let wrong = |field: usize| {
            let text = texts.get(field - 1).copied().unwrap_or_default();
            KrakenError::Number { field, text: text.chars().take(40).collect() }
        };
        // Counted from 1, as everybody does.
        let number = |field: usize| {
            let value = texts.get(field - 1).and_then(|text| text.parse().ok());
            value.filter(|value: &f64| value.abs() < LARGEST).ok_or_else(|| wrong(field))
        };
        let unix_ms = texts.first().and_then(|text| text.parse().ok()).ok_or_else(|| wrong(1))?;
        let spectrum = (BEFORE + 1..=FIELDS).map(number).collect::<Result<Vec<_>, _>>()?;
        let highest = spectrum.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Ok(Self {
            unix_ms,
            confidence: number(3)?,
            power_db: number(4)?,
            frequency_hz: number(5)?,
            spectrum_db: spectrum.into_iter().map(|value| value - highest).collect(),
        })
    }

    /// The direction of the spectrum's maximum, in radians counter-clockwise of the array's front.
    #[must_use]
    pub fn direction(&self) -> f64 {
        let highest = (0_u16..).zip(&self.spectrum_db).max_by(|a, b| a.1.total_cmp(b.1));
        highest.map_or(0.0, |(index, _)| f64::from(index) * TAU / 360.0)
    }

    /// The line as the receiver writes it, without the fields that are not read.
    #[must_use]
    pub fn write(&self) -> String {
        let clockwise = (360.0 - self.direction().to_degrees()).rem_euclid(360.0);
        let mut text = format!(
            "{}, {clockwise:.0}, {:.2}, {:.2}, {:.0}, UCA, 100, foxhunt, 0.0, 0.0, 0, 0, \
             Kraken, R, R, R, R",
            self.unix_ms, self.confidence, self.power_db, self.frequency_hz
        );
        for value in &self.spectrum_db {
            text.push_str(&format!(", {value:.2}"));
        }
        text.push('\n');
        text
    }
}

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
    #[error("the server's answer begins with {line:?}, which is not HTTP")]
    NoHttp {
        /// First line of the answer.
        line: String,
    },
    /// The server refuses.
    #[error("the server answers {status}")]
    Status {
        /// Number of the status, such as 404.
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
    use approx::assert_abs_diff_eq;
    use proptest::prelude::*;

    use super::*;

    fn doa(front: u16) -> KrakenDoa {
        let aside = |bin: u16| {
            let apart = bin.abs_diff(front);
            f64::from(apart.min(360 - apart))
        };
        KrakenDoa {
            unix_ms: 1_700_000_000_123,
            confidence: 9.5,
            power_db: -42.25,
            frequency_hz: 433_920_000.0,
            spectrum_db: (0..360).map(|bin| -0.25 * aside(bin)).collect(),
        }
    }

    #[test]
    fn lines_come_back_as_they_were() {
        for front in [0, 1, 90, 359] {
            let written = doa(front);
            let read = KrakenDoa::line(written.write().trim()).expect("it is in order");
            assert_eq!(read, written);
            assert_abs_diff_eq!(read.direction(), f64::from(front).to_radians(), epsilon = 1e-12);
        }
        let page = format!("<html>{}</html>\n{}", doa(3).write().trim(), doa(7).write());
        let lines = KrakenDoa::page(&page);
        assert_eq!(lines, [Ok(doa(3)), Ok(doa(7))]);
    }

    #[test]
    fn torn_lines_and_other_texts_are_refused() {
        let line = doa(3).write();
        let (torn, _) = line.trim().rsplit_once(',').expect("it has fields");
        assert_eq!(KrakenDoa::line(torn), Err(KrakenError::Fields { fields: 376 }));
        assert_eq!(KrakenDoa::line("hello"), Err(KrakenError::Fields { fields: 1 }));
        let wrong = KrakenDoa::line(&line.trim().replace("-42.25, 4339", "NaN, 4339"));
        assert_eq!(wrong, Err(KrakenError::Number { field: 4, text: "NaN".into() }));
    }

    proptest! {
        #[test]
        fn nothing_breaks_it(text in ".*", fields in prop::collection::vec("[0-9.e-]{1,6}", 377)) {
            let _ = KrakenDoa::page(&text);
            let _ = KrakenDoa::line(&fields.join(","));
        }
    }

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
        fn nothing_breaks_an_http_response(bytes: Vec<u8>, ok: bool) {
            let mut response = HttpResponse::default();
            if ok {
                response.push(b"HTTP/1.0 200 OK\r\n").expect("it is in order");
            }
            let _ = response.push(&bytes);
            let _ = response.end();
        }
    }
}
