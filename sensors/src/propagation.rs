//! Laws of received power over range.

use core::{
    f64::consts::{LN_10, PI, TAU},
    ops::RangeInclusive,
};

use foxhunt_core::{
    elementary,
    parameter::{self, ParameterError},
};

/// The ranges over which the laws of this crate are followed; beyond either end the power stays
/// what it is there. A millimetre is nearer than two antennas can come, so only the singularity
/// at range 0 is cut off; the far end keeps an overflowed distance finite.
const RANGES: RangeInclusive<f64> = 1e-3..=1e300;

/// The squares of these, up to the largest number.
const SQUARES: RangeInclusive<f64> = 1e-6..=f64::MAX;

/// Received power against the slant range between transmitter and receiver.
///
/// ```
/// use foxhunt_sensors::{Propagation, Rss};
///
/// /// 20 dB a decade up to a wall at 30 m, which takes 12 dB over half a metre.
/// struct Walled;
///
/// impl Propagation for Walled {
///     fn rss_dbm(&self, range: f64) -> f64 {
///         let range = range.clamp(1e-3, 1e9);
///         -30.0 - 20.0 * range.log10() - 12.0 * ((range - 30.0) / 0.5).clamp(0.0, 1.0)
///     }
///
///     fn slope(&self, range: f64) -> f64 {
///         let wall = if (30.0..30.5).contains(&range) { -24.0 } else { 0.0 };
///         let law = -20.0 / (core::f64::consts::LN_10 * range);
///         if (1e-3..=1e9).contains(&range) { law + wall } else { 0.0 }
///     }
/// }
///
/// let model = Rss::new(Walled);
/// assert!((model.propagation().rss_dbm(100.0) + 82.0).abs() < 1e-9);
/// ```
///
/// # Laws
///
/// Both methods are finite at every range, 0 and infinity among them; `slope` is the
/// derivative of `rss_dbm`, and 0 outside the ranges over which the law is followed;
/// `square_slope` agrees with `slope`, `many_rss_dbm` with `rss_dbm`.
pub trait Propagation {
    /// The mean received power in dBm at `range` metres.
    fn rss_dbm(&self, range: f64) -> f64;

    /// Returns the derivative of the power at `range`, in dB per metre.
    fn slope(&self, range: f64) -> f64;

    /// dP/d(d²) where the square of the range is `square` m² and not 0, in dB per m²; a law of
    /// that square saves the root.
    fn square_slope(&self, square: f64) -> f64 {
        let range = libm::sqrt(square);
        0.5 * self.slope(range) / range
    }

    /// dP/d(ln d²) in dB where it is the same at every range: P is then linear in the logarithm.
    fn log_slope(&self) -> Option<f64> {
        None
    }

    /// The powers in dBm at many ranges, in the place of the squares of these in m².
    ///
    /// One range after the other unless overridden. An override is a plain loop with the functions
    /// of [`elementary`], and `#[inline(always)]`: models compile it for wider vectors.
    #[inline(always)]
    fn many_rss_dbm(&self, squares: &mut [f64]) {
        squares.iter_mut().for_each(|x| *x = self.rss_dbm(libm::sqrt(*x)));
    }
}

/// A borrowed law is a law.
impl<P: ?Sized + Propagation> Propagation for &P {
    fn rss_dbm(&self, range: f64) -> f64 {
        (**self).rss_dbm(range)
    }

    fn slope(&self, range: f64) -> f64 {
        (**self).slope(range)
    }

    fn square_slope(&self, square: f64) -> f64 {
        (**self).square_slope(square)
    }

    fn log_slope(&self) -> Option<f64> {
        (**self).log_slope()
    }

    #[inline(always)]
    fn many_rss_dbm(&self, squares: &mut [f64]) {
        (**self).many_rss_dbm(squares);
    }
}

/// Free space: P = Pt + Dt + Dr + 20 log₁₀(λ / 4πd) (Friis 1946; Pritzl 2018, eq. 3.4).
///
/// It holds in the far field, d ≫ λ and d ≫ the antennas; nearer than λ/4π it would have
/// more received than sent. (The text beside Pritzl's eq. 3.4 has the inequality the wrong way
/// round.)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friis {
    power_dbm: f64,
    transmitter_gain_dbi: f64,
    receiver_gain_dbi: f64,
    wavelength: f64,
}

impl Friis {
    /// The law for the power sent in dBm, both antennas' gains in dBi, and the wavelength in
    /// metres.
    ///
    /// # Errors
    ///
    /// Names the parameter that is not finite, or the wavelength that is not positive.
    pub fn new(
        power_dbm: f64,
        transmitter_gain_dbi: f64,
        receiver_gain_dbi: f64,
        wavelength: f64,
    ) -> Result<Self, ParameterError> {
        Ok(Self {
            power_dbm: parameter::finite("power_dbm", power_dbm)?,
            transmitter_gain_dbi: parameter::finite("transmitter_gain_dbi", transmitter_gain_dbi)?,
            receiver_gain_dbi: parameter::finite("receiver_gain_dbi", receiver_gain_dbi)?,
            wavelength: parameter::positive("wavelength", wavelength)?,
        })
    }
}

impl Propagation for Friis {
    fn rss_dbm(&self, range: f64) -> f64 {
        let spread = libm::log10(self.wavelength / (4.0 * PI)) - libm::log10(clamp(range).0);
        self.power_dbm + self.transmitter_gain_dbi + self.receiver_gain_dbi + 20.0 * spread
    }

    fn slope(&self, range: f64) -> f64 {
        let (range, inside) = clamp(range);
        if inside { -20.0 / (LN_10 * range) } else { 0.0 }
    }

    fn log_slope(&self) -> Option<f64> {
        Some(-10.0 / LN_10)
    }

    #[inline(always)]
    fn many_rss_dbm(&self, squares: &mut [f64]) {
        many_log_distance(squares, self.rss_dbm(1.0), 2.0);
    }
}

/// The log-distance law, P(d) = P₀ − 10 γ log₁₀(d / 1 m) (Pritzl 2018, eq. 3.7).
///
/// Followed from 1 mm on; nearer, the power stays what it is there.
///
/// ```
/// use foxhunt_sensors::{LogDistance, Propagation};
/// # fn main() -> Result<(), foxhunt_sensors::ParameterError> {
/// let law = LogDistance::new(-30.0, 2.0)?;
/// assert!((law.rss_dbm(10.0) + 50.0).abs() < 1e-12);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "Fields", into = "Fields"))]
pub struct LogDistance {
    reference_dbm: f64,
    exponent: f64,
}

impl LogDistance {
    /// P₀ = 0, γ = 1: the effect of one unit of the exponent.
    pub(super) const UNIT: Self = Self { reference_dbm: 0.0, exponent: 1.0 };

    /// The law with the power P₀ at one metre, in dBm, and the exponent γ: 2 in free space, more
    /// near the ground.
    ///
    /// # Errors
    ///
    /// Names the parameter that is not finite, or the exponent that is not positive.
    pub fn new(reference_dbm: f64, exponent: f64) -> Result<Self, ParameterError> {
        Ok(Self {
            reference_dbm: parameter::finite("reference_dbm", reference_dbm)?,
            exponent: parameter::positive("exponent", exponent)?,
        })
    }

    /// The law identified in the open field: P₀ = −29.06 dBm, γ = 2.765 (Pritzl 2018, §7.1).
    #[must_use]
    pub fn pritzl2018_field() -> Self {
        Self { reference_dbm: -29.06, exponent: 2.765 }
    }

    /// The law identified between houses: P₀ = −33.96 dBm, γ = 3 (Pritzl 2018, §7.2).
    #[must_use]
    pub fn pritzl2018_urban() -> Self {
        Self { reference_dbm: -33.96, exponent: 3.0 }
    }

    /// P₀: the power at one metre, in dBm.
    #[must_use]
    pub fn reference_dbm(&self) -> f64 {
        self.reference_dbm
    }

    /// γ: the fall of the power for each tenfold range, in tens of dB.
    #[must_use]
    pub fn exponent(&self) -> f64 {
        self.exponent
    }

    /// Sets P₀ = 0: the loss alone.
    pub(super) fn without_reference(self) -> Self {
        Self { reference_dbm: 0.0, ..self }
    }
}

impl Propagation for LogDistance {
    #[inline]
    fn rss_dbm(&self, range: f64) -> f64 {
        self.reference_dbm - 10.0 / LN_10 * self.exponent * elementary::ln(clamp(range).0)
    }

    #[inline]
    fn slope(&self, range: f64) -> f64 {
        let (range, inside) = clamp(range);
        if inside { -10.0 * self.exponent / (LN_10 * range) } else { 0.0 }
    }

    #[inline]
    fn square_slope(&self, square: f64) -> f64 {
        let inside = SQUARES.contains(&square);
        if inside { -5.0 / LN_10 * self.exponent / square } else { 0.0 }
    }

    #[inline]
    fn log_slope(&self) -> Option<f64> {
        Some(-5.0 / LN_10 * self.exponent)
    }

    #[inline(always)]
    fn many_rss_dbm(&self, squares: &mut [f64]) {
        many_log_distance(squares, self.reference_dbm, self.exponent);
    }
}

/// The fields as they stand in a file; read back only through [`LogDistance::new`].
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Fields {
    reference_dbm: f64,
    exponent: f64,
}

#[cfg(feature = "serde")]
impl TryFrom<Fields> for LogDistance {
    type Error = ParameterError;

    fn try_from(fields: Fields) -> Result<Self, ParameterError> {
        Self::new(fields.reference_dbm, fields.exponent)
    }
}

#[cfg(feature = "serde")]
impl From<LogDistance> for Fields {
    fn from(law: LogDistance) -> Self {
        Self { reference_dbm: law.reference_dbm, exponent: law.exponent }
    }
}

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

/// Direct wave and reflection from a flat ground (Rappaport 2002, §4.6):
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

/// `range` within [`RANGES`], and true if it was there already.
#[inline]
fn clamp(range: f64) -> (f64, bool) {
    (range.clamp(*RANGES.start(), *RANGES.end()), RANGES.contains(&range))
}

/// P₁ − 10 γ log₁₀ d of many ranges, in the place of their squares, from the power P₁ at
/// one metre and γ.
#[inline(always)]
fn many_log_distance(squares: &mut [f64], at_one_metre: f64, exponent: f64) {
    let scale = 5.0 / LN_10 * exponent;
    squares.iter_mut().for_each(|x| {
        *x = at_one_metre - scale * elementary::ln(x.clamp(*SQUARES.start(), *SQUARES.end()));
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn the_textbook_loss_at_2_4_ghz() {
        // 20 log₁₀ d[km] + 20 log₁₀ f[MHz] + 32.45 dB: 80.05 dB over 100 m at 2.4 GHz.
        let law = Friis::new(0.0, 0.0, 0.0, 299_792_458.0 / 2.4e9).expect("proper");
        assert_abs_diff_eq!(law.rss_dbm(100.0), -80.052, epsilon = 1e-3);
        let louder = Friis::new(20.0, 2.0, 8.0, 299_792_458.0 / 2.4e9).expect("proper");
        assert_abs_diff_eq!(louder.rss_dbm(100.0) - law.rss_dbm(100.0), 30.0, epsilon = 1e-12);
    }

    #[test]
    fn a_wavelength_of_zero_is_refused() {
        assert!(Friis::new(0.0, 0.0, 0.0, 0.0).is_err());
        assert!(Friis::new(f64::NAN, 0.0, 0.0, 1.0).is_err());
    }
}
