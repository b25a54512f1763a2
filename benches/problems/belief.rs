//! Beliefs that eight drones plan from.

use foxhunt::prelude::*;
use nalgebra::{Matrix2, Vector2};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{Distribution, StandardNormal};

/// Particles of equal weight.
pub(crate) struct Cloud {
    pub(crate) places: Vec<Vector2<f64>>,
    pub(crate) moments: Estimate<2>,
}

impl Cloud {
    /// 2000 particles in equal parts about the middles.
    pub(crate) fn about(middles: &[[f64; 2]], sigma: f64) -> Self {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let places: Vec<_> = (0..2000)
            .map(|i| {
                Vector2::from(middles[i % middles.len()]) + Vector2::new(normal(), normal()) * sigma
            })
            .collect();
        let mean = places.iter().sum::<Vector2<f64>>() / 2000.0;
        let square = |place: &Vector2<f64>| (place - mean) * (place - mean).transpose();
        let covariance = places.iter().map(square).sum::<Matrix2<f64>>() / 2000.0;
        Self { places, moments: Estimate { mean, covariance } }
    }
}

impl Belief for Cloud {
    fn position(&self) -> Estimate<2> {
        self.moments
    }

    fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64)) {
        self.places.iter().for_each(|place| visit(place, 1.0 / 2000.0));
    }
}

/// Drones on a line South of the belief.
pub(crate) fn drones() -> Vec<Station> {
    (0..8).map(|i| Station::holding(Pose::at(4.0 * f64::from(i), -50.0, 4.0))).collect()
}
