//! Elementary functions without branches, so that a loop over columns is vectorised.
//!
//! The reductions and most polynomials come from fdlibm (Sun Microsystems 1993). There is no fused
//! multiplication in them and no table: a vector of any width gives the same bits as one number
//! after the other, on every processor. Each is inlined wherever it stands, into functions that are
//! compiled for wider vectors too.

use core::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, LOG2_E, PI};

/// Adding it rounds a number below 2⁵¹ to a whole one, which then stands in the lowest bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// ln 2 in two parts, the first of 33 bits: its product with an exponent is exact.
const LN_2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];

/// eˣ to 1 unit in the last place: 0 below −708, infinite above 709.
#[inline(always)]
#[must_use]
pub fn exp(x: f64) -> f64 {
    let shifted = x * LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = (x - n * LN_2[0]) - n * LN_2[1];
    let z = r * r;
    // (eʳ − 1 − r) / r² interpolated at the Chebyshev nodes of |r| ≤ ½ ln 2, to 2·10⁻¹⁷ of eʳ:
    // fdlibm's has a division, which costs more.
    let even = 0.500_000_000_000_000_1
        + z * (0.041_666_666_666_624_164
            + z * (0.001_388_888_891_719_671_9
                + z * (2.480_152_132_236_869_2e-5 + z * 2.762_007_587_998_336_7e-7)));
    let odd = 0.166_666_666_666_666_69
        + z * (0.008_333_333_333_330_065
            + z * (0.000_198_412_698_630_405_45
                + z * (2.755_726_848_031_002_4e-6 + z * 2.510_037_583_256_123_4e-8)));
    let y = 1.0 + (r + z * (even + r * odd));
    let scale = f64::from_bits((shifted.to_bits() << 52).wrapping_add(1023 << 52));
    let value = if x < -708.0 { 0.0 } else { y * scale };
    if x > 709.0 { f64::INFINITY } else { value }
}

/// ln x of a finite number, to 1 unit in the last place: −∞ below the smallest normal number, NaN
/// below 0.
#[inline(always)]
#[must_use]
pub fn ln(x: f64) -> f64 {
    // x = 2ᵏ (1 + f) with √½ ≤ 1 + f < √2.
    const ROOT_HALF: u64 = 0x3fe6_a09e << 32;
    const BIASED: f64 = 4_503_599_627_370_496.0 + 1023.0;
    let bits = x.to_bits().wrapping_add((0x3ff << 52) - ROOT_HALF);
    let k = f64::from_bits((0x433 << 52) | (bits >> 52)) - BIASED;
    let f = f64::from_bits((bits & ((1 << 52) - 1)) + ROOT_HALF) - 1.0;
    let half_square = 0.5 * f * f;
    let s = f / (2.0 + f);
    let z = s * s;
    let w = z * z;
    // In pairs, so that few terms wait for each other (Estrin 1960).
    let (first, second) = (
        (0.666_666_666_666_673_5 + z * 0.399_999_999_994_094_2)
            + w * (0.285_714_287_436_623_9 + z * 0.222_221_984_321_497_84),
        (0.181_835_721_616_180_5 + z * 0.153_138_376_992_093_73) + w * 0.147_981_986_051_165_86,
    );
    let series = first + w * w * second;
    let rest = s * half_square + (k * LN_2[1] - half_square);
    let value = (s * z * series + rest) + f + k * LN_2[0];
    let small = if x >= 0.0 { f64::NEG_INFINITY } else { f64::NAN };
    if x >= f64::MIN_POSITIVE { value } else { small }
}

/// ln Φ(x), Φ the distribution function of N(0, 1), to 5·10⁻⁹ of Φ and, above 0, of 1 −
/// Φ.
#[inline(always)]
#[must_use]
pub fn ln_normal_cdf(x: f64) -> f64 {
    /// Squares of larger numbers overflow.
    const MOST: f64 = 1e154;
    let t = if x.abs() < MOST { x.abs() } else { MOST };
    // (1 + 2 z) exp(z²) erfc(z) over (z − 3) / (z + 3) (the form of Shepherd & Laframboise
    // 1981), interpolated at the Chebyshev nodes.
    let z = t * FRAC_1_SQRT_2;
    let u = (z - 3.0) / (z + 3.0);
    let w = u * u;
    let even = (1.253_008_056_367_755_5 + w * -0.047_562_156_927_521_18)
        + w * w
            * ((-0.119_275_275_282_231 + w * -0.023_763_576_439_522_306)
                + w * w * (0.001_875_079_123_802_778_8 + w * -9.254_516_688_133_58e-5));
    let odd = (-0.135_621_069_400_274_02 + w * 0.129_644_114_344_088_4)
        + w * w
            * ((0.068_316_567_771_101_46 + w * 0.002_499_116_869_694_825_3)
                + w * w * (-0.000_726_453_679_118_51 + w * 7.731_024_227_011_126e-5));
    let ratio = 0.5 * (even + u * odd) / (1.0 + 2.0 * z);
    let half_square = 0.5 * t * t;
    let is_below = x < 0.0;
    let part = if is_below { ratio } else { 1.0 - exp(-half_square) * ratio };
    let value = ln(part) - if is_below { half_square } else { 0.0 };
    if x.is_nan() { x } else { value }
}

/// √x, correctly rounded everywhere.
#[inline(always)]
#[must_use]
pub fn sqrt(x: f64) -> f64 {
    // The one of libm is an instruction that compilers cannot widen.
    #[cfg(feature = "std")]
    return x.sqrt();
    #[cfg(not(feature = "std"))]
    return libm::sqrt(x);
}

/// The direction of (x, y) in [−π, π] to 9·10⁻¹⁶; 0 at the origin. Neither may be beyond 10³⁰⁰, and
/// the larger counts as no smaller than the smallest normal number.
#[inline(always)]
#[must_use]
pub fn atan2(y: f64, x: f64) -> f64 {
    const ATAN_HALF: f64 = 0.463_647_609_000_806_1;
    let across = y.abs();
    let along = x.abs();
    // In this form a NaN comes out, and nothing is divided by zero.
    let low = if across < along { across } else { along };
    let high = if along > across { along } else { across };
    let high = if f64::MIN_POSITIVE > high { f64::MIN_POSITIVE } else { high };
    // atan t = atan ½ + atan u with u in [−½, ⅓], for every t in [0, 1].
    let u = (low - 0.5 * high) / (high + 0.5 * low);
    let z = u * u;
    let w = z * z;
    let v = w * w;
    // (u − atan u) / u³ by Remez's algorithm, to 2·10⁻¹⁷ of the angle; in pairs, too.
    let (first, second, third) = (
        (0.333_333_333_333_176_8 - z * 0.199_999_999_971_480_44)
            + w * (0.142_857_140_898_093_87 - z * 0.111_111_040_692_099_16),
        (0.090_907_570_642_054_96 - z * 0.076_901_890_607_279_3)
            + w * (0.066_468_502_569_456_24 - z * 0.057_557_262_176_816_46),
        (0.047_097_803_090_235_084 - z * 0.031_306_846_504_253_84) + w * 0.011_836_412_548_886_578,
    );
    let series = first + v * (second + v * third);
    let angle = ATAN_HALF + (u - u * z * series);
    // From the axis ahead or back.
    let axis = if x < 0.0 { PI } else { 0.0 };
    let axis = if across > along { FRAC_PI_2 } else { axis };
    let angle = axis + angle.copysign((along - across) * x);
    angle.copysign(y)
}

/// (sin x, cos x) for |x| ≤ π/4, to 1 unit in the last place of 1.
#[inline(always)]
#[must_use]
pub fn sin_cos_octant(x: f64) -> (f64, f64) {
    let z = x * x;
    let sin = -0.166_666_666_666_666_32
        + z * (0.008_333_333_333_322_49
            + z * (-0.000_198_412_698_298_579_5
                + z * (2.755_731_370_707_006_8e-6
                    + z * (-2.505_076_025_340_686_3e-8 + z * 1.589_690_995_211_55e-10))));
    let cos = 0.041_666_666_666_666_6
        + z * (-0.001_388_888_888_887_411
            + z * (2.480_158_728_947_673e-5
                + z * (-2.755_731_435_139_066_3e-7
                    + z * (2.087_572_321_298_175e-9 - z * 1.135_964_755_778_819_5e-11))));
    (x + x * z * sin, 1.0 - (0.5 * z - z * z * cos))
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use core::f64::consts::FRAC_PI_4;

    use super::*;
    use crate::noise::log_normal_cdf;

    /// Numbers spread evenly over [−reach, reach].
    fn spread(reach: f64) -> impl Iterator<Item = f64> {
        (-100_000..=100_000_i32).map(move |i| f64::from(i) * reach / 100_000.0)
    }

    #[test]
    fn they_agree_with_libm() {
        const ULP: f64 = f64::EPSILON;
        for x in spread(707.9) {
            let near = exp(x);
            let far = exp(x / 700.0);
            assert!(abs_diff_eq!(near / libm::exp(x), 1.0, epsilon = 2.0 * ULP), "exp {x}: {near}");
            assert!(abs_diff_eq!(far / libm::exp(x / 700.0), 1.0, epsilon = 2.0 * ULP), "exp {x}");
            let value = libm::exp(x);
            let exact = libm::log(value);
            assert!(abs_diff_eq!(ln(value), exact, epsilon = ULP * exact.abs()), "ln {value}");
            assert_eq!(sqrt(value).to_bits(), libm::sqrt(value).to_bits());
            let value = 1.0 + x / 2000.0;
            let exact = libm::log(value);
            assert!(abs_diff_eq!(ln(value), exact, epsilon = ULP * exact.abs()), "ln {value}");
        }
        for x in spread(FRAC_PI_4) {
            let (sin, cos) = sin_cos_octant(x);
            assert!((sin - libm::sin(x)).abs() <= ULP && (cos - libm::cos(x)).abs() <= ULP, "{x}");
        }
        for turn in spread(PI) {
            for range in [1e-250, 1e-3, 1.0, 7e5, 1e250] {
                let y = range * libm::sin(turn);
                let x = range * libm::cos(turn);
                let off = atan2(y, x) - libm::atan2(y, x);
                assert!(abs_diff_eq!(off, 0.0, epsilon = 9e-16), "{y}, {x}: {off}");
            }
        }
    }

    #[test]
    fn the_normal_distribution_agrees_with_libm() {
        for x in spread(40.0) {
            let [read, exact] = [ln_normal_cdf(x), log_normal_cdf(x)];
            let bound = 5e-9 * (1.5 * exact.abs()).min(1.0);
            assert!(abs_diff_eq!(read, exact, epsilon = bound + 1e-12), "{x}: {read} {exact}");
        }
        assert_abs_diff_eq!(ln_normal_cdf(1e300), 0.0, epsilon = 1e-15);
        assert!(ln_normal_cdf(f64::NEG_INFINITY) < -1e300 && ln_normal_cdf(f64::NAN).is_nan());
    }

    #[test]
    fn the_ends_are_as_they_are_described() {
        assert_eq!(exp(f64::NEG_INFINITY).to_bits(), 0);
        assert_eq!((exp(-1e300).to_bits(), exp(-709.0).to_bits()), (0, 0));
        assert!(exp(1e300).is_infinite() && exp(f64::NAN).is_nan());
        assert_abs_diff_eq!(exp(0.0), 1.0, epsilon = 0.0);
        assert_abs_diff_eq!(ln(1.0), 0.0, epsilon = 0.0);
        assert!(ln(0.0) < -f64::MAX && ln(-1.0).is_nan() && ln(f64::NAN).is_nan());
        assert_abs_diff_eq!(atan2(0.0, 0.0), 0.0, epsilon = 0.0);
        assert!(atan2(f64::NAN, 0.0).is_nan() && atan2(1.0, f64::NAN).is_nan());
        for (y, x) in [(0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0), (2.0, 2.0), (-2.0, -2.0)] {
            assert!(abs_diff_eq!(atan2(y, x), libm::atan2(y, x), epsilon = 9e-16), "{y}, {x}");
        }
    }
}
