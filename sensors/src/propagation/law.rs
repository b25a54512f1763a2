use core::{f64::consts::LN_10, ops::RangeInclusive};

use foxhunt_core::elementary;

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

    /// Its derivative at `range`, in dB per metre.
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

/// The ranges over which the laws of this crate are followed; beyond either end the power stays
/// what it is there. A millimetre is nearer than two antennas can come, so only the singularity
/// at range 0 is cut off; the far end keeps an overflowed distance finite.
const RANGES: RangeInclusive<f64> = 1e-3..=1e300;

/// The squares of these, up to the largest number.
pub(crate) const SQUARES: RangeInclusive<f64> = 1e-6..=f64::MAX;

/// `range` within [`RANGES`], and true if it was there already.
#[inline]
pub(crate) fn clamp(range: f64) -> (f64, bool) {
    (range.clamp(*RANGES.start(), *RANGES.end()), RANGES.contains(&range))
}

/// P₁ − 10 γ log₁₀ d of many ranges, in the place of their squares, from the power P₁ at one metre
/// and γ.
#[inline(always)]
pub(crate) fn many_log_distance(squares: &mut [f64], at_one_metre: f64, exponent: f64) {
    let scale = 5.0 / LN_10 * exponent;
    squares.iter_mut().for_each(|x| {
        *x = at_one_metre - scale * elementary::ln(x.clamp(*SQUARES.start(), *SQUARES.end()));
    });
}
