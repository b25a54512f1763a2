//! Antennas whose gain is a formula.

use core::f64::consts::{FRAC_PI_2, LN_2, PI, TAU};

use foxhunt_core::parameter::{self, ParameterError};

use super::{Antenna, gain::mean_over_sphere};

/// 4 / Cin(2π): the directivity (eq. 4-91).
const DIRECTIVITY: f64 = 1.640_922_376_984_585;

/// Power relative to the maximum, −60 dB, at which the formulas' nulls are cut off: a real
/// antenna's nulls are filled.
const NULL_POWER: f64 = 1e-6;

/// An antenna that has the same gain in all directions: 0 dBi.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Isotropic;

impl Antenna for Isotropic {
    fn gain_dbi(&self, _azimuth: f64, _elevation: f64) -> f64 {
        0.0
    }

    fn mean_gain_db(&self, _elevation: f64) -> f64 {
        0.0
    }
}

/// A lossless half-wave dipole along the vertical: 2.15 dBi all round the horizon, nulls above and
/// below (Balanis 2016, eq. 4-84 and 4-91). The nulls are cut off 60 dB below the maximum.
///
/// ```
/// use foxhunt_sensors::{Antenna, Dipole};
/// assert!((Dipole.gain_dbi(1.0, 0.0) - 2.15).abs() < 0.01);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dipole;

impl Antenna for Dipole {
    fn gain_dbi(&self, _azimuth: f64, elevation: f64) -> f64 {
        10.0 * libm::log10(DIRECTIVITY) + decibels(half_wave_dipole(elevation))
    }

    fn mean_gain_db(&self, elevation: f64) -> f64 {
        self.gain_dbi(0.0, elevation)
    }
}

/// A dipole or a sensing antenna over a loop: the field (1 + b cos ψ) / (1 + b) at the angle ψ
/// from boresight, a limaçon; with b = 1 the cardioid (Jenkins 1991, §3.4).
///
/// Lossless: its gain is its directivity, (1 + b)² / (1 + b²/3), 4.77 dBi with b = 1.
/// Rotationally symmetric about the boresight; the null is cut off 60 dB below the maximum.
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

/// A patch or panel by its data sheet: beamwidths in both planes and front-to-back ratio.
///
/// The power in each principal plane is ((1 + cos ψ) / 2)ⁿ at the angle ψ from boresight, with
/// n such that it halves at half the beamwidth. Between the planes it is cos² χ of one plane's
/// power and sin² χ of the other's at the angle χ round the boresight, as the fields of a cosⁿ
/// source are (Balanis 2016, §15.4.1, after Rahmat-Samii); with a back lobe
/// 10^(−F/10) ((1 − cos ψ) / 2)³. Lossless: its gain is its directivity. Cut off 60 dB
/// below the maximum.
///
/// ```
/// use foxhunt_sensors::{Antenna, Patch};
/// # fn main() -> Result<(), foxhunt_sensors::ParameterError> {
/// let panel = Patch::new(70_f64.to_radians(), 70_f64.to_radians(), 17.0)?;
/// assert!((panel.main_lobe().gain_dbi - 9.1).abs() < 0.1);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    azimuth_exponent: f64,
    elevation_exponent: f64,
    /// Relative to the maximum.
    back_power: f64,
    peak_dbi: f64,
}

impl Patch {
    /// The one with these half-power beamwidths in radians, below half a turn, and this
    /// front-to-back ratio in dB.
    ///
    /// # Errors
    ///
    /// Names the beamwidth that is not in (0, π), or the ratio that is not a positive number.
    pub fn new(
        azimuth_beamwidth: f64,
        elevation_beamwidth: f64,
        front_to_back_db: f64,
    ) -> Result<Self, ParameterError> {
        let ratio = parameter::positive("front_to_back_db", front_to_back_db)?;
        let mut patch = Self {
            azimuth_exponent: exponent("azimuth_beamwidth", azimuth_beamwidth)?,
            elevation_exponent: exponent("elevation_beamwidth", elevation_beamwidth)?,
            back_power: libm::exp10(-0.1 * ratio),
            peak_dbi: 0.0,
        };
        patch.peak_dbi = -10.0 * libm::log10(mean_over_sphere(|a, e| patch.power(a, e)));
        Ok(patch)
    }

    /// The power relative to that on boresight.
    fn power(&self, azimuth: f64, elevation: f64) -> f64 {
        let [forward, left, up] = direction(azimuth, elevation);
        let aside = left * left + up * up;
        let ahead = 0.5 * (1.0 + forward);
        // On boresight both planes give the same gain.
        let share = if aside > f64::MIN_POSITIVE { left * left / aside } else { 0.5 };
        share * libm::pow(ahead, self.azimuth_exponent)
            + (1.0 - share) * libm::pow(ahead, self.elevation_exponent)
            + back_lobe(forward, self.back_power)
    }
}

impl Antenna for Patch {
    fn gain_dbi(&self, azimuth: f64, elevation: f64) -> f64 {
        self.peak_dbi + decibels(self.power(azimuth, elevation))
    }
}

/// A Yagi of vertical half-wave elements, as the end-fire array of raised directivity that its
/// surface wave makes of it (Hansen & Woodyard 1938; Balanis 2016, §6.3.4 and §10.3.3).
///
/// n elements at the spacing d, fed with the phase −(k d + π/n) from one to the next: the field
/// sin(n ψ/2) / sin(ψ/2) with ψ = k d (cos γ − 1) − π/n at the angle γ from boresight,
/// times that of a dipole, with the back lobe of [`Patch`](crate::Patch). Lossless: its gain is its
/// directivity. Cut off 60 dB below the maximum. Against NEC models with three and five elements it
/// errs by 3° of beamwidth and 1.0 dB of gain at most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Yagi {
    elements: f64,
    /// k d.
    electrical_spacing: f64,
    /// Relative to the maximum.
    back_power: f64,
    peak_dbi: f64,
}

impl Yagi {
    /// The one with this many elements, 3 to 64, their spacing in wavelengths, at most 0.3, and the
    /// power that its reflector lets through behind, in dB below the maximum.
    ///
    /// # Errors
    ///
    /// Names the parameter that is out of range.
    pub fn new(
        elements: u16,
        spacing_wavelengths: f64,
        front_to_back_db: f64,
    ) -> Result<Self, ParameterError> {
        let holds = (3..=64).contains(&elements);
        parameter::require(holds, "elements", elements.into(), "3 to 64")?;
        // At wider spacings the array has a second main lobe behind.
        let holds = spacing_wavelengths > 0.0 && spacing_wavelengths <= 0.3;
        let requirement = "above 0, at most 0.3";
        parameter::require(holds, "spacing_wavelengths", spacing_wavelengths, requirement)?;
        let ratio = parameter::positive("front_to_back_db", front_to_back_db)?;
        let mut yagi = Self {
            elements: f64::from(elements),
            electrical_spacing: TAU * spacing_wavelengths,
            back_power: libm::exp10(-0.1 * ratio),
            peak_dbi: 0.0,
        };
        yagi.peak_dbi = -10.0 * libm::log10(mean_over_sphere(|a, e| yagi.power(a, e)));
        Ok(yagi)
    }

    /// The power relative to that on boresight.
    fn power(&self, azimuth: f64, elevation: f64) -> f64 {
        let [forward, ..] = direction(azimuth, elevation);
        let half = 0.5 * (self.electrical_spacing * (forward - 1.0) - PI / self.elements);
        // ψ stays away from 0 and −2π, where the quotient has its grating lobes.
        let boresight = libm::sin(0.5 * PI / self.elements);
        let array = boresight * libm::sin(self.elements * half) / libm::sin(half);
        (array * array + back_lobe(forward, self.back_power)) * half_wave_dipole(elevation)
    }
}

impl Antenna for Yagi {
    fn gain_dbi(&self, azimuth: f64, elevation: f64) -> f64 {
        self.peak_dbi + decibels(self.power(azimuth, elevation))
    }
}

/// n of ((1 + cos ψ) / 2)ⁿ that is 1/2 at half the beamwidth.
fn exponent(name: &'static str, beamwidth: f64) -> Result<f64, ParameterError> {
    // A narrower lobe would fall between the steps of the directivity's integral.
    let holds = (PI / 180.0..PI).contains(&beamwidth);
    parameter::require(holds, name, beamwidth, "between 1° and 180°, in radians")?;
    Ok(-LN_2 / libm::log(0.5 * (1.0 + libm::cos(0.5 * beamwidth))))
}

/// A power in dB, nulls filled.
fn decibels(power: f64) -> f64 {
    10.0 * libm::log10(power.max(NULL_POWER))
}

/// A direction as a unit vector: forward, left, up.
fn direction(azimuth: f64, elevation: f64) -> [f64; 3] {
    let level = libm::cos(elevation);
    [level * libm::cos(azimuth), level * libm::sin(azimuth), libm::sin(elevation)]
}

/// The lobe to the rear, over the forward component of the direction: `power` straight back, and a
/// tenth of that at about 94° from there. The form is the reference patch's.
fn back_lobe(forward: f64, power: f64) -> f64 {
    let behind = 0.5 * (1.0 - forward);
    power * behind * behind * behind
}

/// The power of a half-wave dipole along Up, relative to that at the horizon:
/// (cos(π/2 · sin e) / cos e)² (Balanis 2016, eq. 4-84, with the angle from the axis π/2 −
/// e).
fn half_wave_dipole(elevation: f64) -> f64 {
    // cos(π/2 · sin e) = sin(π/2 · (1 − |sin e|)), and 1 − |sin e| = cos² e / (1 + |sin
    // e|): no cancellation at the poles.
    let cos = libm::cos(elevation);
    let sin = libm::fabs(libm::sin(elevation));
    if cos.abs() < f64::MIN_POSITIVE {
        return 0.0;
    }
    let field = libm::sin(FRAC_PI_2 * cos * cos / (1.0 + sin)) / cos;
    field * field
}
