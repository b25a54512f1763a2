use core::f64::consts::LN_2;

/// The gain in dB about that on boresight, `angle` radians off it: a lobe ((1 + cos a)/2)ⁿ of this
/// half-power beamwidth in radians over a back lobe that is the same everywhere.
///
/// Pattern of a short Yagi in its place: the side lobes of its free-space pattern drown in what the
/// site scatters.
pub(crate) fn lobe_db(angle: f64, beamwidth: f64, front_to_back_db: f64) -> f64 {
    let power = |a: f64| libm::log(0.5 * (1.0 + libm::cos(a)).max(1e-300));
    let exponent = -LN_2 / power(0.5 * beamwidth);
    let back = libm::exp10(-0.1 * front_to_back_db);
    10.0 * libm::log10(libm::exp(exponent * power(angle)) + back)
}

#[cfg(test)]
mod tests {
    use core::f64::consts::PI;

    use super::*;

    #[test]
    fn half_the_power_is_at_half_the_beamwidth() {
        for width in [0.6, 1.2, 2.4] {
            let fall = lobe_db(0.0, width, 60.0) - lobe_db(0.5 * width, width, 60.0);
            assert!((fall - 3.0103).abs() < 1e-3, "{fall}");
            assert!((lobe_db(PI, width, 16.0) + 16.0).abs() < 1e-6);
        }
    }
}
