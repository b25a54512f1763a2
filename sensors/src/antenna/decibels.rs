/// Converts a gain in dB to a factor of power.
pub(super) fn linear(gain_db: f64) -> f64 {
    libm::exp10(0.1 * gain_db)
}
