use core::f64::consts::{LN_10, PI, TAU};

use super::{Propagation, clamp};
use foxhunt_core::parameter::{self, ParameterError};

/// Direction of a wave's electric field to the ground that reflects it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum Polarisation {
    /// In the plane of incidence: antennas that stand upright.
    #[default]
    Vertical,
    /// Along the ground.
    Horizontal,
}

/// The direct wave and the one that a flat ground reflects (Rappaport 2002, §4.6):
/// P = Pt + 20 log₁₀((λ / 4π) |1/d + Γ e^(−jk(d′ − d)) / d′|), d the slant range and
/// d′ = √(d² + 4 h₁ h₂) the way over the ground.
///
/// Γ is Fresnel's coefficient of a ground without losses (eq. 4.24, 4.25). Near by, the two
/// beat about [`Friis`](crate::Friis)'s law; where the grazing angle is small they cancel, and the
/// power falls with the fourth power of the range, Pt + 20 log₁₀(h₁ h₂ / d²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoRay {
    power_dbm: f64,
    wavelength: f64,
    /// Heights of the transmitter and the receiver.
    heights: [f64; 2],
    permittivity: f64,
    polarisation: Polarisation,
}

/// Sum of the two waves, relative to the direct one, and its change per metre.
struct Sum {
    value: [f64; 2],
    slope: [f64; 2],
}

impl TwoRay {
    /// The relative permittivity of ground neither wet nor dry (ITU-R P.527).
    pub const MEDIUM_GROUND: f64 = 15.0;

    /// The law for the power sent and both antennas' gains together, in dBm, the wavelength and the
    /// heights of transmitter and receiver above the ground in metres; over
    /// [`MEDIUM_GROUND`](Self::MEDIUM_GROUND), vertically polarised.
    ///
    /// # Errors
    ///
    /// Names the parameter that is not finite, or that should be positive and is not.
    pub fn new(
        power_dbm: f64,
        wavelength: f64,
        transmitter_height: f64,
        receiver_height: f64,
    ) -> Result<Self, ParameterError> {
        Ok(Self {
            power_dbm: parameter::finite("power_dbm", power_dbm)?,
            wavelength: parameter::positive("wavelength", wavelength)?,
            heights: [
                parameter::positive("transmitter_height", transmitter_height)?,
                parameter::positive("receiver_height", receiver_height)?,
            ],
            permittivity: Self::MEDIUM_GROUND,
            polarisation: Polarisation::Vertical,
        })
    }

    /// Replaces the ground's relative permittivity, 1 for no ground, and the polarisation.
    ///
    /// # Errors
    ///
    /// If the permittivity is not a number of at least 1.
    pub fn with_ground(
        self,
        permittivity: f64,
        polarisation: Polarisation,
    ) -> Result<Self, ParameterError> {
        let holds = permittivity >= 1.0 && permittivity.is_finite();
        let permittivity =
            parameter::require(holds, "permittivity", permittivity, "a number of at least 1")?;
        Ok(Self { permittivity, polarisation, ..self })
    }

    /// 1 + Γ (d / d′) e^(−jkΔ) with Δ = d′ − d, and its derivative over d.
    fn sum(&self, range: f64) -> Sum {
        let [first, second] = self.heights;
        let other = libm::hypot(range, 2.0 * libm::sqrt(first) * libm::sqrt(second));
        let excess = 4.0 * first * second / (range + other);
        // The sine of the grazing angle; nearer than the heights allow, straight down.
        let steep = (first + second) / other;
        let (sine, slope) =
            if steep < 1.0 { (steep, -steep * (range / other) / other) } else { (1.0, 0.0) };
        let (reflected, missing, per_sine) = self.reflection(sine);
        // The range over d′, its derivative (d′² − d²) / d′³, and 1 − d/d′.
        let ratio = range / other;
        let ratio_slope = (excess / other) * (1.0 + ratio) / other;
        let phase = TAU / self.wavelength * excess;
        let sin = libm::sin(phase);
        let cos = libm::cos(phase);
        // 1 + Γ r c = (1 + Γ) + Γ (r c − 1), each without cancellation.
        let half = libm::sin(0.5 * phase);
        let short = -excess / other - ratio * 2.0 * half * half;
        let value = [missing + reflected * short, -reflected * ratio * sin];
        // dΔ/dd = −Δ / d′.
        let phase_slope = -TAU / self.wavelength * (excess / other);
        let amplitude_slope = per_sine * slope * ratio + reflected * ratio_slope;
        let amplitude = reflected * ratio * phase_slope;
        Sum {
            value,
            slope: [
                amplitude_slope * cos - amplitude * sin,
                -amplitude_slope * sin - amplitude * cos,
            ],
        }
    }

    /// Γ at the sine of a grazing angle, 1 + Γ, and dΓ over the sine.
    fn reflection(&self, sine: f64) -> (f64, f64, f64) {
        let e = self.permittivity;
        // √(ε − cos² ψ).
        let inside = libm::sqrt(e - 1.0 + sine * sine);
        let weight = match self.polarisation {
            Polarisation::Vertical => e,
            Polarisation::Horizontal => 1.0,
        };
        let whole = weight * sine + inside;
        let slope = 2.0 * weight * (e - 1.0) / inside / (whole * whole);
        ((weight * sine - inside) / whole, 2.0 * weight * sine / whole, slope)
    }
}

impl Propagation for TwoRay {
    fn rss_dbm(&self, range: f64) -> f64 {
        let range = clamp(range).0;
        let [real, imaginary] = self.sum(range).value;
        let spread = libm::log10(self.wavelength / (4.0 * PI)) - libm::log10(range);
        let sum = libm::hypot(real, imaginary).max(f64::MIN_POSITIVE);
        self.power_dbm + 20.0 * (spread + libm::log10(sum))
    }

    fn slope(&self, range: f64) -> f64 {
        let (range, inside) = clamp(range);
        let Sum { value, slope } = self.sum(range);
        let length = libm::hypot(value[0], value[1]);
        if !inside || length < f64::MIN_POSITIVE {
            return 0.0;
        }
        let along =
            (value[0] / length) * (slope[0] / length) + (value[1] / length) * (slope[1] / length);
        let slope = 20.0 / LN_10 * (along - 1.0 / range);
        if slope.is_finite() { slope } else { 0.0 }
    }
}
