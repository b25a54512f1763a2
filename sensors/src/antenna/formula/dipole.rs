use super::{Antenna, decibels, half_wave_dipole};

/// A lossless half-wave dipole along the vertical: 2.15 dBi all round the horizon, nulls above and
/// below (Balanis 2016, eq. 4-84 and 4-91). The nulls are cut off 60 dB below the maximum.
///
/// ```
/// use foxhunt_sensors::{Antenna, Dipole};
/// assert!((Dipole.gain_dbi(1.0, 0.0) - 2.15).abs() < 0.01);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dipole;

/// 4 / Cin(2π): the directivity (eq. 4-91).
const DIRECTIVITY: f64 = 1.640_922_376_984_585;

impl Antenna for Dipole {
    fn gain_dbi(&self, _azimuth: f64, elevation: f64) -> f64 {
        10.0 * libm::log10(DIRECTIVITY) + decibels(half_wave_dipole(elevation))
    }

    fn mean_gain_db(&self, elevation: f64) -> f64 {
        self.gain_dbi(0.0, elevation)
    }
}
