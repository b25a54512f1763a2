//! Functions of small numbers, for two places near each other.

/// Below this square of their argument the terms of the series that are left out, the first of them
/// a ninth of its fourth power, are below half the last digit.
const SMALL: f64 = 1.4e-4;

/// arctan x.
#[inline]
pub(crate) fn atan(x: f64) -> f64 {
    let square = x * x;
    if square < SMALL { x * series(-square) } else { libm::atan(x) }
}

/// ln (1 + x), as 2 artanh (x / (2 + x)).
#[inline]
pub(crate) fn ln_1p(x: f64) -> f64 {
    let ratio = x / (2.0 + x);
    let square = ratio * ratio;
    if square < SMALL { 2.0 * ratio * series(square) } else { libm::log1p(x) }
}

/// artanh √z / √z = 1 + z/3 + z²/5 + z³/7 + …
#[inline]
fn series(z: f64) -> f64 {
    1.0 + z * (1.0 / 3.0 + z * (1.0 / 5.0 + z * (1.0 / 7.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_are_the_functions() {
        for i in -2000..=2000_i16 {
            let x = f64::from(i) * 2e-5;
            // Four roundings here, and the last digit of the library's.
            let room = 3.0 * f64::EPSILON * x.abs();
            assert!((atan(x) - libm::atan(x)).abs() <= room, "atan {x}");
            assert!((ln_1p(x) - libm::log1p(x)).abs() <= room, "ln_1p {x}");
        }
        for x in [0.5, 1e300] {
            assert!((atan(x) - libm::atan(x)).abs() <= 0.0);
            assert!((ln_1p(x) - libm::log1p(x)).abs() <= 0.0);
        }
        assert!(atan(f64::NAN).is_nan() && ln_1p(f64::NAN).is_nan());
    }
}
