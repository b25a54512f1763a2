//! Functions of small numbers, for two places near each other.

/// Below this square of their argument the terms of the series that are left out, the first of them
/// a ninth of its fourth power, are below half the last digit.
const SMALL: f64 = 1.4e-4;

/// artanh x of two numbers within (−1, 1), and arctan x of two others: as series of four at once.
#[inline]
pub(crate) fn artanh_arctan(artanh: [f64; 2], arctan: [f64; 2]) -> ([f64; 2], [f64; 2]) {
    let (positive, negative) = (artanh.map(|x| x * x), arctan.map(|x| x * x));
    if positive[0] + positive[1] + negative[0] + negative[1] < SMALL {
        let series = |x: f64, z: f64| x * series(z);
        let [x, y] = artanh;
        let [u, v] = arctan;
        (
            [series(x, positive[0]), series(y, positive[1])],
            [series(u, -negative[0]), series(v, -negative[1])],
        )
    } else {
        (artanh.map(libm::atanh), arctan.map(libm::atan))
    }
}

/// artanh √z / √z = 1 + z/3 + z²/5 + z³/7 + …
#[inline]
fn series(z: f64) -> f64 {
    (1.0 + z * (1.0 / 3.0)) + z * z * (1.0 / 5.0 + z * (1.0 / 7.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_are_the_functions() {
        for i in -2000..=2000_i16 {
            let x = f64::from(i) * 2e-5;
            // Four roundings here, and the last digits of the library's.
            let room = 4.0 * f64::EPSILON * x.abs();
            let ([hyperbolic, _], [circular, _]) = artanh_arctan([x, 0.0], [x, 0.0]);
            assert!((hyperbolic - libm::atanh(x)).abs() <= room, "artanh {x}");
            assert!((circular - libm::atan(x)).abs() <= room, "arctan {x}");
        }
        let ([_, hyperbolic], [_, circular]) = artanh_arctan([0.0, 0.5], [0.0, 1e300]);
        assert!((hyperbolic - libm::atanh(0.5)).abs() <= 0.0);
        assert!((circular - libm::atan(1e300)).abs() <= 0.0);
        let ([hyperbolic, _], [_, circular]) = artanh_arctan([f64::NAN, 0.0], [0.0; 2]);
        assert!(hyperbolic.is_nan() && circular.abs() <= 0.0);
    }
}
