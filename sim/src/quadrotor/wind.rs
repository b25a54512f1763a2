use nalgebra::Vector3;
use rand::{RngExt, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use super::WindConfig;

/// The air about one quadrotor.
#[derive(Clone, Debug)]
pub(super) struct Wind {
    mean: Vector3<f64>,
    gust: Vector3<f64>,
    /// The share of a gust that is kept after a step, and σ of the new part.
    kept: f64,
    fresh: Vector3<f64>,
    rng: Xoshiro256PlusPlus,
}

impl Wind {
    /// Air that is drawn from `rng` every `dt` seconds.
    pub(super) fn new(config: &WindConfig, dt: f64, mut rng: Xoshiro256PlusPlus) -> Self {
        let sigma = config.gust_sigma_mps * Vector3::new(1.0, 1.0, 0.5);
        let kept = libm::exp(-dt / config.gust_time_s);
        Self {
            mean: Vector3::new(config.east_mps, config.north_mps, 0.0),
            gust: sigma.component_mul(&normal(&mut rng)),
            kept,
            fresh: sigma * libm::sqrt(1.0 - kept * kept),
            rng,
        }
    }

    /// Its velocity over the next step, in m/s.
    pub(super) fn next(&mut self) -> Vector3<f64> {
        if self.fresh.x > 0.0 {
            let new = normal(&mut self.rng);
            self.gust = self.gust * self.kept + self.fresh.component_mul(&new);
        }
        self.mean + self.gust
    }
}

fn normal(rng: &mut Xoshiro256PlusPlus) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.sample(StandardNormal))
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn gusts_have_their_deviation_and_their_time() {
        let config = WindConfig {
            east_mps: 3.0,
            gust_sigma_mps: 1.5,
            gust_time_s: 0.5,
            ..WindConfig::default()
        };
        let dt = 0.01;
        let mut wind = Wind::new(&config, dt, Xoshiro256PlusPlus::seed_from_u64(4));
        let east: Vec<f64> = (0..400_000).map(|_| wind.next().x - 3.0).collect();
        // 4000 s are 4000 independent gusts of 2 · 0.5 s: σ² to 2.2 % with one standard deviation,
        // and a band of 4.
        let n = 400_000.0;
        let variance = east.iter().map(|v| v * v).sum::<f64>() / n;
        assert!((variance / 2.25 - 1.0).abs() < 0.09, "{variance}");
        let later: f64 = east.iter().zip(&east[50..]).map(|(a, b)| a * b).sum::<f64>() / n;
        assert!((later / variance - (-1.0_f64).exp()).abs() < 0.09, "{}", later / variance);
    }
}
