use super::{Antenna, decibels, direction};
use foxhunt_core::parameter::{self, ParameterError};

/// A dipole or a sensing antenna over a loop: the field (1 + b cos ψ) / (1 + b) at the angle ψ from
/// boresight, a limaçon; with b = 1 the cardioid (Jenkins 1991, §3.4).
///
/// Lossless: its gain is its directivity, (1 + b)² / (1 + b²/3), 4.77 dBi with b = 1. Rotationally
/// symmetric about the boresight; the null is cut off 60 dB below the maximum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cardioid {
    /// b.
    directional: f64,
    peak_dbi: f64,
}

impl Cardioid {
    /// The one with this front-to-back ratio in dB, 20 log₁₀((1 + b) / (1 − b)).
    ///
    /// # Errors
    ///
    /// If the ratio is not a positive number.
    pub fn new(front_to_back_db: f64) -> Result<Self, ParameterError> {
        let ratio = parameter::positive("front_to_back_db", front_to_back_db)?;
        // (r − 1) / (r + 1) with r = 10^(ratio/20).
        Ok(Self::with_share(libm::tanh(ratio * core::f64::consts::LN_10 / 40.0)))
    }

    fn with_share(b: f64) -> Self {
        let directivity = (1.0 + b) * (1.0 + b) / (1.0 + b * b / 3.0);
        Self { directional: b, peak_dbi: 10.0 * libm::log10(directivity) }
    }
}

/// The cardioid proper: its null is straight behind.
impl Default for Cardioid {
    fn default() -> Self {
        Self::with_share(1.0)
    }
}

impl Antenna for Cardioid {
    fn gain_dbi(&self, azimuth: f64, elevation: f64) -> f64 {
        let [forward, ..] = direction(azimuth, elevation);
        let field = (1.0 + self.directional * forward) / (1.0 + self.directional);
        self.peak_dbi + decibels(field * field)
    }
}
