use std::{
    f64::consts::{FRAC_PI_2, PI},
    rc::Rc,
};

use nalgebra::Vector3;
use rand::{RngExt, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use super::path::Wave;
use crate::ScatteringConfig;

/// Draws the scattered waves of a pattern: the direct wave's share of the power in dB, and the
/// waves.
pub(super) fn draw(
    config: &ScatteringConfig,
    random: &mut Xoshiro256PlusPlus,
) -> (f64, Rc<[Wave]>) {
    let normal: f64 = random.sample(StandardNormal);
    let k = libm::exp10((config.k_db + config.k_sigma_db * normal) / 10.0);
    // The mean square of a Rayleigh variable is twice the square of its scale.
    let scale = libm::sqrt(0.5 / (k * f64::from(config.waves)));
    let elevation_sigma = config.elevation_sigma_deg.to_radians();
    let wave = |_| {
        let [x, y, tilt]: [f64; 3] = std::array::from_fn(|_| random.sample(StandardNormal));
        let azimuth = random.random_range(-PI..PI);
        let elevation = (elevation_sigma * tilt).clamp(-FRAC_PI_2, FRAC_PI_2);
        let level = libm::cos(elevation);
        let east = level * libm::cos(azimuth);
        let north = level * libm::sin(azimuth);
        let sight = Vector3::new(east, north, libm::sin(elevation));
        Wave { sight, amplitude: scale * libm::hypot(x, y), phase: libm::atan2(y, x) }
    };
    let waves = (0..config.waves).map(wave).collect();
    (10.0 * libm::log10(k / (k + 1.0)), waves)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    const URBAN: ScatteringConfig =
        ScatteringConfig { k_db: 3.0, k_sigma_db: 0.0, waves: 6, elevation_sigma_deg: 15.0 };

    /// The direct wave and the scattered ones together have the power of the law, and K is their
    /// ratio; 4000 patterns of six waves, whose mean power has a standard error of 0.7 %.
    #[test]
    fn the_power_is_that_of_the_law() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(7);
        let mut power = 0.0;
        let mut shares = Vec::new();
        for _ in 0..4000 {
            let (share_db, waves) = draw(&URBAN, &mut random);
            power += waves.iter().map(|wave| wave.amplitude * wave.amplitude).sum::<f64>() / 4000.0;
            shares.push(libm::exp10(share_db / 10.0));
        }
        let k = libm::exp10(0.3);
        assert!((power * k - 1.0).abs() < 0.03, "{power}");
        assert!(shares.iter().all(|share| (share * (1.0 + power) - 1.0).abs() < 0.01));
    }

    /// The logarithms of K over 4000 patterns have their median and their σ.
    #[test]
    fn k_is_log_normal() {
        let config = ScatteringConfig { k_sigma_db: 5.0, ..URBAN };
        let mut random = Xoshiro256PlusPlus::seed_from_u64(8);
        let mut k_db: Vec<f64> = (0..4000)
            .map(|_| {
                let share = libm::exp10(draw(&config, &mut random).0 / 10.0);
                10.0 * libm::log10(share / (1.0 - share))
            })
            .collect();
        k_db.sort_by(f64::total_cmp);
        assert!((k_db[2000] - 3.0).abs() < 0.4, "{}", k_db[2000]);
        // 84 % of a Gaussian lie below the median and one σ.
        assert!((k_db[3365] - 8.0).abs() < 0.5, "{}", k_db[3365]);
    }
}
