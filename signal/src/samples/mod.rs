//! Complex samples of a receiver, from files and streams, in chunks that know their place in time.

mod archive;
mod encoding;
mod open;
mod sdriq;
mod source;
mod wave;

pub use open::{OpenOptions, SigMf, open};
pub use source::SampleSource;

use std::io;

use rustfft::num_complex::Complex32;

/// The reason why samples cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SampleError {
    /// A file that cannot be opened.
    #[error("{file}: cannot be opened")]
    Open {
        /// The file.
        file: String,
        /// The cause.
        source: io::Error,
    },
    /// A file or stream that cannot be read any further.
    #[error("{file}: cannot be read after {samples} samples")]
    Read {
        /// The file.
        file: String,
        /// The number of samples that came before.
        samples: u64,
        /// The cause.
        source: io::Error,
    },
    /// A value that cannot be used.
    #[error("{file}: {field} is {value}; it must be {requirement}")]
    Field {
        /// The file.
        file: String,
        /// The name of the value.
        field: String,
        /// The value.
        value: String,
        /// The requirement on the value.
        requirement: String,
    },
}

impl SampleError {
    fn field(
        file: &str,
        field: impl Into<String>,
        value: impl ToString,
        requirement: impl Into<String>,
    ) -> Self {
        Self::Field {
            file: file.to_owned(),
            field: field.into(),
            value: value.to_string(),
            requirement: requirement.into(),
        }
    }
}

/// The format of the bytes of one complex sample: I, then Q, little endian.
///
/// A tone at full scale has amplitude 1, 0 dBFS.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum SampleFormat {
    /// Unsigned bytes, 127.5 for zero, as an RTL-SDR gives them.
    Cu8,
    /// Signed bytes, as a HackRF gives them.
    Cs8,
    /// Signed words of 16 bits, as an Airspy gives them.
    Cs16,
    /// Floats of 32 bits, as GNU Radio writes them.
    Cf32,
}

impl SampleFormat {
    /// Every format.
    pub const ALL: [Self; 4] = [Self::Cu8, Self::Cs8, Self::Cs16, Self::Cf32];

    /// Returns the name of the format, which is also a file's extension.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cu8 => "cu8",
            Self::Cs8 => "cs8",
            Self::Cs16 => "cs16",
            Self::Cf32 => "cf32",
        }
    }

    /// The format of a name or an extension, in either case; also under the names that `rtl_sdr`
    /// (`bin`), HackRF's tools (`complex8`) and GNU Radio (`cfile`, `fc32`) give it.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_str() {
            "cu8" | "bin" | "complex16u" => Self::Cu8,
            "cs8" | "sc8" | "complex16s" => Self::Cs8,
            "cs16" | "sc16" | "complex32s" => Self::Cs16,
            "cf32" | "fc32" | "cfile" | "complex" => Self::Cf32,
            _ => return None,
        })
    }

    /// Returns the number of bytes in a sample.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::Cu8 | Self::Cs8 => 2,
            Self::Cs16 => 4,
            Self::Cf32 => 8,
        }
    }

    /// The power of the noise that rounding to this format's steps gives a sample, over that of a
    /// tone at full scale: a twelfth of a step's square for each of I and Q; of floats 1e-18.
    #[must_use]
    pub fn rounding_noise(self) -> f64 {
        match self {
            Self::Cu8 => 2.0 / 12.0 / 127.5_f64.powi(2),
            Self::Cs8 => 2.0 / 12.0 / 128_f64.powi(2),
            Self::Cs16 => 2.0 / 12.0 / 32768_f64.powi(2),
            Self::Cf32 => 1e-18,
        }
    }

    /// Appends the samples of these bytes; bytes of an incomplete last sample are left out.
    pub fn decode(self, bytes: &[u8], samples: &mut Vec<Complex32>) {
        let pair = |parts: [f32; 2]| Complex32::new(parts[0], parts[1]);
        match self {
            Self::Cu8 => {
                let of = |byte: u8| (f32::from(byte) - 127.5) / 127.5;
                samples.extend(bytes.as_chunks().0.iter().map(|iq: &[u8; 2]| pair(iq.map(of))));
            }
            Self::Cs8 => {
                let of = |byte: u8| f32::from(byte.cast_signed()) / 128.0;
                samples.extend(bytes.as_chunks().0.iter().map(|iq: &[u8; 2]| pair(iq.map(of))));
            }
            Self::Cs16 => samples.extend(bytes.as_chunks().0.iter().map(|[a, b, c, d]| {
                pair([[*a, *b], [*c, *d]].map(|b| f32::from(i16::from_le_bytes(b)) / 32768.0))
            })),
            Self::Cf32 => {
                samples.extend(bytes.as_chunks().0.iter().map(|[a, b, c, d, e, f, g, h]| {
                    pair([[*a, *b, *c, *d], [*e, *f, *g, *h]].map(f32::from_le_bytes))
                }));
            }
        }
    }
}
