use super::{Antenna, linear};

/// A wave that reaches an antenna beside the direct one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReflectedWave {
    /// Azimuth that it comes from, in radians counter-clockwise of the boresight.
    pub azimuth: f64,
    /// Elevation that it comes from, in radians above the plane through the boresight.
    pub elevation: f64,
    /// The amplitude of its field over that of the direct wave, before the antenna.
    pub amplitude: f64,
    /// Phase by which it leads the direct wave, in radians.
    pub phase: f64,
}

/// Waves that cancel are this far below the direct one on boresight, in dB.
const CANCELLED_DB: f64 = -200.0;

/// Gain of an antenna for a direct wave and its reflections, in dB over the direct wave at an
/// isotropic antenna: 20 log₁₀ |g(a) + Σ Γᵢ e^(jφᵢ) g(aᵢ)| with the amplitude g = 10^(G/20).
///
/// The antenna's own phase is taken for the same in all directions; patterns do not hold it.
#[must_use]
pub fn multipath_gain_dbi(
    antenna: &(impl Antenna + ?Sized),
    azimuth: f64,
    elevation: f64,
    reflected: &[ReflectedWave],
) -> f64 {
    let direct = antenna.gain_dbi(azimuth, elevation);
    if reflected.is_empty() {
        return direct;
    }
    let mut real = 1.0;
    let mut imaginary = 0.0;
    for wave in reflected {
        let gain = antenna.gain_dbi(wave.azimuth, wave.elevation) - direct;
        let amplitude = wave.amplitude * libm::sqrt(linear(gain));
        real += amplitude * libm::cos(wave.phase);
        imaginary += amplitude * libm::sin(wave.phase);
    }
    let sum = 20.0 * libm::log10(libm::hypot(real, imaginary));
    direct + sum.max(CANCELLED_DB)
}
