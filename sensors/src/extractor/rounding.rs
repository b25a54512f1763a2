/// A window's mean this near to a half, in dB, is the half.
///
/// The mean of whole-dB readings is a fraction whose denominator is the window times the common
/// multiple of the counts: with the reference's six readings and seven positions it is a half or
/// at least 1/840 dB off. Floating-point sums err by some 1e-13 dB, in a way that hangs on the
/// order of summation; 1e-9 lies between, so the result is that of exact sums in any order.
const TIE: f64 = 1e-9;

/// `value` in whole numbers, halves away from zero; what is a half up to [`TIE`] is a half.
pub(super) fn round_half_away(value: f64) -> f64 {
    libm::copysign(libm::floor(value.abs() + (0.5 + TIE)), value)
}

/// Length of a mean resultant below which directions cancel, up to rounding.
pub(super) const LEAST_RESULTANT: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;

    fn same(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-12
    }

    #[test]
    fn halves_go_away_from_zero_whatever_the_last_bits() {
        for near in [-1e-12, 0.0, 1e-12] {
            assert!(same(round_half_away(-48.5 + near), -49.0));
            assert!(same(round_half_away(48.5 + near), 49.0));
        }
        assert!(same(round_half_away(-48.5 + 1.0 / 840.0), -48.0));
        assert!(same(round_half_away(-48.5 - 1.0 / 840.0), -49.0));
        assert!(same(round_half_away(-0.2), 0.0));
    }
}
