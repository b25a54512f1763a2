//! The models with a free power and exponent under the filter that integrates these out.

use foxhunt::{
    filters::{ParticleFilter, RaoBlackwellised},
    prelude::*,
    sensors::{FreePathLossRssBearing, FreePowerRssBearing},
};
use nalgebra::{Matrix2, Vector2, Vector3, Vector4};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

/// A flight round a transmitter at (14, 9) of −35 dBm and an exponent of 2.6, without noise but
/// taken for noisy: 4 dB and 10°.
fn flight() -> Vec<Observation<2>> {
    let truth = Vector4::new(14.0, 9.0, -35.0, 2.6);
    let model = FreePathLossRssBearing::new();
    (0..12_u8)
        .map(|step| {
            let (sin, cos) = (f64::from(step) * 0.9).sin_cos();
            let drone = Pose::at(30.0 * cos, 20.0 * sin, 5.0);
            let noise = Matrix2::from_diagonal(&Vector2::new(16.0, 0.03));
            let expected = MeasurementModel::<4, 2>::expected(&model, &truth, &drone);
            Observation::new(f64::from(step), drone, expected, noise).expect("it is proper")
        })
        .collect()
}

fn end<const N: usize>(mut estimator: impl Estimator<N, 2>) -> Estimate<N> {
    for observation in flight() {
        estimator.predict(1.0).expect("a proper step");
        let _ = estimator.update(&observation).expect("it is possible");
    }
    estimator.estimate()
}

fn rng() -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(8)
}

#[test]
fn a_power_integrated_out_is_what_a_large_cloud_makes_of_it() {
    let model = FreePowerRssBearing::new(2.6).expect("it is in range");
    let prior = Estimate {
        mean: Vector3::new(0.0, 0.0, -30.0),
        covariance: Covariance::<3>::from_diagonal(&Vector3::new(400.0, 400.0, 100.0)),
    };
    let walk = RandomWalk { drift: Vector3::new(0.02, 0.02, 0.02) };
    let cloud = ParticleFilter::new(walk, model, prior, 100_000, rng()).expect("it is proper");
    let made = RaoBlackwellised::<_, _, _, 3, 2, 1>::new(walk, model, prior, 3000, rng());
    let exact = end(cloud);
    let marginal = end(made.expect("it is proper"));
    let white = exact.nees(&marginal.mean).expect("it is definite").sqrt();
    // Two clouds, of 100 000 and 3000 particles: their own errors are 0.02 σ and 0.1 σ.
    assert!(white < 0.3, "{white} σ off: {} {}", marginal.mean, exact.mean);
    let ratio = marginal.covariance[(2, 2)] / exact.covariance[(2, 2)];
    assert!((0.8..1.25).contains(&ratio), "{ratio}");
}

#[test]
fn power_and_exponent_are_found_together() {
    let prior = Estimate {
        mean: Vector4::new(0.0, 0.0, -30.0, 2.8),
        covariance: Covariance::<4>::from_diagonal(&Vector4::new(400.0, 400.0, 100.0, 0.16)),
    };
    let walk = RandomWalk { drift: Vector4::new(0.02, 0.02, 0.0, 0.0) };
    let model = FreePathLossRssBearing::new();
    let made = RaoBlackwellised::<_, _, _, 4, 2, 2>::new(walk, model, prior, 3000, rng());
    let marginal = end(made.expect("it is proper"));
    let truth = Vector4::new(14.0, 9.0, -35.0, 2.6);
    // Observations without noise: within the belief, and that is narrow.
    assert!(marginal.nees(&truth).expect("it is definite") < 4.0, "{}", marginal.mean);
    assert!(marginal.covariance[(0, 0)].sqrt() < 2.0, "{}", marginal.covariance);
}
