use nalgebra::Vector3;
use rand::{RngExt, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use crate::ShadowingConfig;

/// The number of waves that make a field. The correlation of one field about e^(−d/D) errs by about
/// the inverse root of this number.
const WAVES: usize = 256;

/// A Gaussian field over places with an exponential correlation, as a sum of plane waves (Cai &
/// Giannakis 2003).
///
/// Wave vectors are drawn from the correlation's spectral density, which in three dimensions is a
/// multivariate Cauchy density of scale 1/D, and the amplitudes of sines and cosines are Gaussian:
/// at every place, and over every two, the field has exactly the moments that are requested.
#[derive(Clone, Debug)]
pub(super) struct ShadowingField {
    /// The wave vectors, in radians per metre.
    waves: Vec<Vector3<f64>>,
    /// Amplitudes of each wave's cosine and sine, in dB.
    amplitudes: Vec<[f64; 2]>,
}

impl ShadowingField {
    pub(super) fn draw(config: &ShadowingConfig, rng: &mut Xoshiro256PlusPlus) -> Self {
        let mut normal = || -> f64 { rng.sample(StandardNormal) };
        #[expect(clippy::cast_precision_loss, reason = "a few hundred")]
        let scale = config.sigma_db / (WAVES as f64).sqrt();
        let mut waves = Vec::new();
        let mut amplitudes = Vec::new();
        for _ in 0..WAVES {
            let direction = Vector3::new(normal(), normal(), normal());
            // A normal vector over a normal number is a Cauchy vector; none is infinitely short.
            let wave = direction / (normal().abs().max(1e-9) * config.correlation_m);
            waves.push(wave);
            amplitudes.push([scale * normal(), scale * normal()]);
        }
        Self { waves, amplitudes }
    }

    /// The field at a place, in dB.
    pub(super) fn at(&self, place: &Vector3<f64>) -> f64 {
        let wave = |(wave, [cos, sin]): (&Vector3<f64>, &[f64; 2])| {
            let phase = wave.dot(place);
            cos * libm::cos(phase) + sin * libm::sin(phase)
        };
        self.waves.iter().zip(&self.amplitudes).map(wave).sum()
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    /// 4000 fields of seeds 1 to 4000. The variance's standard error is √(2/4000) of it, the
    /// correlation's at most 1/√4000; four of them are a false-alarm rate of 6·10⁻⁵ each.
    #[test]
    fn its_moments_are_those_of_its_configuration() {
        let config = ShadowingConfig { sigma_db: 6.0, correlation_m: 25.0 };
        let place = Vector3::new(-40.0, 17.0, 30.0);
        let aside = [5.0, 25.0, 60.0].map(|d| (d, Vector3::new(0.6 * d, -0.64 * d, 0.48 * d)));
        let mut square = 0.0;
        let mut products = [0.0; 3];
        for seed in 1..=4000 {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
            let field = ShadowingField::draw(&config, &mut rng);
            let here = field.at(&place);
            square += here * here / 4000.0;
            for ((_, step), product) in aside.iter().zip(&mut products) {
                *product += here * field.at(&(place + step)) / 4000.0;
            }
        }
        assert!((square / 36.0 - 1.0).abs() < 4.0 * (2.0_f64 / 4000.0).sqrt(), "{square}");
        for ((distance, _), product) in aside.iter().zip(products) {
            let expected = (-distance / 25.0_f64).exp();
            let error = product / 36.0 - expected;
            assert!(error.abs() < 4.0 * (1.0_f64 + expected.powi(2)).sqrt() / 4000.0_f64.sqrt());
        }
    }

    /// A drone that comes back receives the same; one that moves a little nearly the same.
    #[test]
    fn it_belongs_to_places() {
        let config = ShadowingConfig { sigma_db: 6.0, correlation_m: 25.0 };
        let field = ShadowingField::draw(&config, &mut Xoshiro256PlusPlus::seed_from_u64(5));
        let here = field.at(&Vector3::new(3.0, 4.0, 5.0));
        assert!((field.at(&Vector3::new(3.0, 4.0, 5.0)) - here).abs() < 1e-12);
        // σ of the difference over 1 cm: 6 √(2 · 0.0004) dB.
        let beside = field.at(&Vector3::new(3.01, 4.0, 5.0));
        assert!((beside - here).abs() < 1.0 && (beside - here).abs() > 1e-9);
    }
}
