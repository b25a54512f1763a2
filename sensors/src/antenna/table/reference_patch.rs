use alloc::vec::Vec;

use core::f64::consts::TAU;

use super::PatternTable;

impl PatternTable {
    /// A patch in the place of the reference's CW8DPA: 70.1° half-power beamwidth, 17.0 dB
    /// front-to-back ratio, side lobes at ±105°; in rows of 0.25°.
    ///
    /// These figures are ours: of the antenna the document prints nothing but a gain of 8 dBi
    /// (Pritzl 2018). The table holds the gain over its maximum, 0 dB on boresight, and is the
    /// same at every elevation, which a directivity of 6.67 dBi follows from. The 8 dBi are in the
    /// identified reference power, as only the gain over the mean of a turn counts.
    #[must_use]
    pub fn reference_patch() -> Self {
        const ROWS: u16 = 1440;
        let gain = |i| gain_db(TAU * f64::from(i) / f64::from(ROWS));
        let gains: Vec<f64> = (0..ROWS).map(gain).collect();
        Self::equally_spaced(&gains).expect("the formula is finite at every angle")
    }
}

/// The linear gain ((1 + cos a)/2)^7.3 + 10^−1.7 ((1 − cos a)/2)³ + 10^−1.85 × two von
/// Mises side lobes at ±105° (κ = 10, peak 1), in dB.
fn gain_db(a: f64) -> f64 {
    const SIDE: f64 = 105.0 / 360.0 * TAU;
    let cos = libm::cos(a);
    let side = |at: f64| libm::exp(10.0 * (libm::cos(a - at) - 1.0));
    let main = libm::pow(0.5 * (1.0 + cos), 7.3);
    let back = libm::exp10(-1.7) * libm::pow(0.5 * (1.0 - cos), 3.0);
    10.0 * libm::log10(main + back + libm::exp10(-1.85) * (side(SIDE) + side(-SIDE)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Antenna;

    /// Our figures, so that the table cannot change unseen: no document prints them.
    #[test]
    fn the_table_has_our_figures() {
        let patch = PatternTable::reference_patch();
        let width = patch.half_power_beamwidth().expect("it is directional").to_degrees();
        assert!((width - 70.1).abs() < 0.1, "{width}° wide");
        assert!((patch.front_to_back_db() - 17.0).abs() < 0.1, "{} dB", patch.front_to_back_db());
        assert!((patch.directivity_dbi() - 6.67).abs() < 0.01, "{} dBi", patch.directivity_dbi());
        assert!(patch.gain_db(0.0).abs() < 1e-2, "{} dB on boresight", patch.gain_db(0.0));
    }

    #[test]
    fn between_rows_it_follows_the_formula() {
        // The fourth derivative is below 2000 dB/rad⁴ at the side lobes; times 5/384 of the step to
        // its fourth power.
        let patch = PatternTable::reference_patch();
        for i in 0..1000 {
            let a = f64::from(i) * 0.00637 - 3.0;
            assert!((patch.gain_db(a) - gain_db(a)).abs() < 1e-8, "at {a}");
            assert!((gain_db(a) - gain_db(-a)).abs() < 1e-12, "left and right are the same");
        }
    }
}
