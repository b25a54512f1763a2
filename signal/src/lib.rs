//! Radio pulses: detected in complex samples, and given to the tags that sent them.

pub mod detector;
pub mod samples;
pub mod tags;

mod waterfall;

pub use rustfft::num_complex::Complex32;
pub use waterfall::{Waterfall, WaterfallRow};

use serde::{Deserialize, Serialize};

/// One pulse of a transmitter, as a detector measures it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Pulse {
    /// Time of its middle, in seconds of the samples' clock.
    pub time_s: f64,
    /// The carrier's frequency, in hertz; absolute where the receiver's centre is known, otherwise
    /// relative to it.
    pub frequency_hz: f64,
    /// Duration of the pulse, in seconds.
    pub width_s: f64,
    /// The mean power while it lasts, in dBm, or in dB of full scale where the receiver is not
    /// calibrated.
    pub power_dbm: f64,
    /// The energy over the noise's power density, E/N0, in dB.
    pub snr_db: f64,
}

impl Pulse {
    /// A pulse of those measurements.
    #[must_use]
    pub const fn new(
        time_s: f64,
        frequency_hz: f64,
        width_s: f64,
        power_dbm: f64,
        snr_db: f64,
    ) -> Self {
        Self { time_s, frequency_hz, width_s, power_dbm, snr_db }
    }
}
