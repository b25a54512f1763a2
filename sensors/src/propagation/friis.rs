use core::f64::consts::{LN_10, PI};

use super::{Propagation, clamp, many_log_distance};
use foxhunt_core::parameter::{self, ParameterError};

/// Free space: P = Pt + Dt + Dr + 20 log₁₀(λ / 4πd) (Friis 1946; Pritzl 2018, eq. 3.4).
///
/// It holds in the far field, d ≫ λ and d ≫ the antennas; nearer than λ/4π it would have more
/// received than sent. (The text beside Pritzl's eq. 3.4 has the inequality the wrong way round.)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_textbook_loss_at_2_4_ghz() {
        // 20 log₁₀ d[km] + 20 log₁₀ f[MHz] + 32.45 dB: 80.05 dB over 100 m at 2.4 GHz.
        let law = Friis::new(0.0, 0.0, 0.0, 299_792_458.0 / 2.4e9).expect("proper");
        assert!((law.rss_dbm(100.0) + 80.052).abs() < 1e-3);
        let louder = Friis::new(20.0, 2.0, 8.0, 299_792_458.0 / 2.4e9).expect("proper");
        assert!((louder.rss_dbm(100.0) - law.rss_dbm(100.0) - 30.0).abs() < 1e-12);
    }

    #[test]
    fn a_wavelength_of_zero_is_refused() {
        assert!(Friis::new(0.0, 0.0, 0.0, 0.0).is_err());
        assert!(Friis::new(f64::NAN, 0.0, 0.0, 1.0).is_err());
    }
}
