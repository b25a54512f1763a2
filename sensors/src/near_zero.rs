//! Functions of small numbers, for two places near each other.

/// Below this square of their argument the terms of the series that are left out, the first of them
/// a ninth of its fourth power, are below half the last digit.
const SMALL: f64 = 1.4e-4;

/// artanh x of two numbers and arctan x of two others, all with squares below 1.4·10⁻⁴: as
/// series of four at once.
#[inline]
pub(crate) fn artanh_arctan(artanh: [f64; 2], arctan: [f64; 2]) -> ([f64; 2], [f64; 2]) {
    debug_assert!(artanh.iter().chain(&arctan).all(|x| x * x < SMALL), "{artanh:?}, {arctan:?}");
    let artanh = artanh.map(|x| {
        let [even, odd] = terms(x * x);
        x * (even + odd)
    });
    let arctan = arctan.map(|x| {
        let [even, odd] = terms(x * x);
        x * (even - odd)
    });
    (artanh, arctan)
}

/// The even and the odd terms of artanh √z / √z = 1 + z/3 + z²/5 + z³/7 + …, whose
/// difference is arctan √z / √z.
#[inline]
fn terms(z: f64) -> [f64; 2] {
    let w = z * z;
    [1.0 + w * (1.0 / 5.0), z * (1.0 / 3.0 + w * (1.0 / 7.0))]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_are_the_functions() {
        for i in -2000..=2000_i16 {
            let x = f64::from(i) * 5.9e-6;
            // Four roundings here, and the last digits of the library's.
            let room = 4.0 * f64::EPSILON * x.abs();
            let ([hyperbolic, _], [circular, _]) = artanh_arctan([x, 0.0], [x, 0.0]);
            assert!((hyperbolic - libm::atanh(x)).abs() <= room, "artanh {x}");
            assert!((circular - libm::atan(x)).abs() <= room, "arctan {x}");
        }
    }
}
