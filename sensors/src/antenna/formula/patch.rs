use core::f64::consts::{LN_2, PI};

use super::{Antenna, back_lobe, decibels, direction, mean_over_sphere};
use foxhunt_core::parameter::{self, ParameterError};

/// A patch or panel by its data sheet: beamwidths in both planes and front-to-back ratio.
///
/// The power in each principal plane is ((1 + cos ψ) / 2)ⁿ at the angle ψ from boresight, with n
/// such that it halves at half the beamwidth. Between the planes it is cos² χ of the one and sin² χ
/// of the other at the angle χ round the boresight, as the fields of a cosⁿ source are (Balanis
/// 2016, §15.4.1, after Rahmat-Samii); with a back lobe 10^(−F/10) ((1 − cos ψ) / 2)³.
/// Lossless: its gain is its directivity. Cut off 60 dB below the maximum.
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

/// n of ((1 + cos ψ) / 2)ⁿ that is 1/2 at half the beamwidth.
fn exponent(name: &'static str, beamwidth: f64) -> Result<f64, ParameterError> {
    // A narrower lobe would fall between the steps of the directivity's integral.
    let holds = (PI / 180.0..PI).contains(&beamwidth);
    parameter::require(holds, name, beamwidth, "between 1° and 180°, in radians")?;
    Ok(-LN_2 / libm::log(0.5 * (1.0 + libm::cos(0.5 * beamwidth))))
}

impl Antenna for Patch {
    fn gain_dbi(&self, azimuth: f64, elevation: f64) -> f64 {
        self.peak_dbi + decibels(self.power(azimuth, elevation))
    }
}
