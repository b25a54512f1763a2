/// A number as the stepper messages carry it: a decimal significand of 23 bits, and an exponent of
/// 10 from −11 to 4.
///
/// Numbers are truncated to fit, as the protocol demands and other hosts do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Decimal {
    negative: bool,
    significand: u32,
    exponent: i8,
}

/// One more than the largest significand.
const LIMIT: f64 = 8_388_608.0;

/// The exponent is sent with this added.
const BIAS: i8 = 11;

/// The largest exponent that has room in 4 bits.
const LARGEST: i32 = 4;

impl Decimal {
    /// The largest number: `8_388_607 · 10⁴`.
    pub const MAX: Self = Self { negative: false, significand: 8_388_607, exponent: 4 };

    /// The number of at most as many digits as fit whose magnitude is next below that of `value`;
    /// `None` where it is not finite or more than [`MAX`](Self::MAX). Magnitudes below 10⁻¹¹ become
    /// 0.
    ///
    /// The digits equal firmata-io's. A significand of exactly 2²³, which that library sends as 0,
    /// loses a digit here, and exponents that it wraps are kept in their range.
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "whole numbers below 2²³, and log10 of f64"
    )]
    #[expect(clippy::cast_sign_loss, reason = "a magnitude")]
    pub fn truncated(value: f64) -> Option<Self> {
        if !value.is_finite() || value.abs() > Self::MAX.to_f64() {
            return None;
        }
        let mut digits = value.abs();
        if digits < 1e-11 {
            return Some(Self::default());
        }
        let mut exponent = digits.log10().floor() as i32;
        digits /= 10_f64.powi(exponent);
        while digits.fract() != 0.0 && digits < LIMIT || exponent > LARGEST {
            exponent -= 1;
            digits *= 10.0;
        }
        while digits >= LIMIT || exponent < -i32::from(BIAS) {
            exponent += 1;
            digits /= 10.0;
        }
        Some(Self { negative: value < 0.0, significand: digits as u32, exponent: exponent as i8 })
    }

    /// Converts it to `f64`.
    #[must_use]
    pub fn to_f64(self) -> f64 {
        let magnitude = f64::from(self.significand);
        // Division by an exact power is rounded once; multiplication by 10⁻ⁿ would be twice.
        let power = 10_f64.powi(i32::from(self.exponent).abs());
        let magnitude = if self.exponent < 0 { magnitude / power } else { magnitude * power };
        if self.negative { -magnitude } else { magnitude }
    }

    pub(super) fn encode(self) -> [u8; 4] {
        let [low, middle, high] = [0, 7, 14].map(|bit| seven(self.significand >> bit));
        let exponent = u8::try_from(self.exponent + BIAS).unwrap_or(0);
        let sign = u8::from(self.negative) << 6;
        [low, middle, high, seven(self.significand >> 21) | exponent << 2 | sign]
    }

    /// The number of four bytes as they are sent.
    #[must_use]
    pub fn decode([low, middle, high, last]: [u8; 4]) -> Self {
        let significand = u32::from(low)
            | u32::from(middle) << 7
            | u32::from(high) << 14
            | u32::from(last & 0x03) << 21;
        let exponent = (last >> 2 & 0x0F).cast_signed() - BIAS;
        Self { negative: last & 0x40 != 0, significand, exponent }
    }
}

fn seven(bits: u32) -> u8 {
    u8::try_from(bits & 0x7F).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_ends_of_the_range_are_kept() {
        let made = |value| Decimal::truncated(value).map(Decimal::to_f64);
        assert_eq!(made(0.0), Some(0.0));
        assert_eq!(Decimal::default().encode()[..3], [0, 0, 0]);
        assert_eq!(made(8_388_608.0), Some(8_388_600.0), "2²³ loses a digit, not its meaning");
        assert_eq!(made(1e6), Some(1e6));
        assert_eq!(made(8.388_607e10), Some(8.388_607e10));
        assert_eq!(made(-1.234_567_89e-8), Some(-1.234e-8));
        assert_eq!(made(1e-12), Some(0.0));
        assert_eq!([made(f64::NAN), made(f64::INFINITY), made(8.4e10)], [None; 3]);
    }

    proptest! {
        #[test]
        fn numbers_are_truncated_by_less_than_a_digit(value in -1e5..1e5f64) {
            let made = Decimal::truncated(value).expect("in range");
            let step = (value.abs() / 838_860.0).max(1e-11);
            // The division that shifts the digits rounds.
            let rounding = value.abs() * 1e-15;
            prop_assert!(made.to_f64().abs() <= value.abs() + rounding);
            prop_assert!((made.to_f64() - value).abs() <= step, "{value} made {made:?}");
            prop_assert_eq!(Decimal::decode(made.encode()), made);
        }

        #[test]
        fn any_four_bytes_are_a_number(bytes in prop::array::uniform4(0u8..0x80)) {
            prop_assert_eq!(Decimal::decode(bytes).encode(), bytes);
        }
    }
}
