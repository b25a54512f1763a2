//! A transmitter in the air, in three dimensions: a state of place and velocity, a measurement of
//! one's own with exact slopes, and an extended Kalman filter.
//!
//! `cargo run --example space`

#![expect(clippy::print_stdout, reason = "an example shows what it found")]

use foxhunt::{
    core::{ConstantVelocity, Differentiated, DualMeasurement, Number},
    filters::Ekf,
    nalgebra::{Matrix3, Vector3, Vector6},
    prelude::*,
};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

// ANCHOR: model
/// Distance, azimuth and elevation of a target in space, as a radar has them.
struct Radar;

impl DualMeasurement<6, 3> for Radar {
    fn quantities(&self) -> [Quantity; 3] {
        let elevation = Quantity::angle("elevation_rad");
        [Quantity::linear("slant_range_m"), Quantity::BEARING, elevation]
    }

    // Written once: over `f64` it is the measurement, over dual numbers its Jacobian.
    fn expected<T: Number>(&self, state: [T; 6], receiver: &Pose) -> [T; 3] {
        let [east, north, up, ..] = state;
        let east = east - receiver.position.x;
        let north = north - receiver.position.y;
        let up = up - receiver.position.z;
        let ground = (east * east + north * north).sqrt();
        [(ground * ground + up * up).sqrt(), north.atan2(east), up.atan2(ground)]
    }
}
// ANCHOR_END: model

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    let mut normal = || rng.sample::<f64, _>(StandardNormal);
    // q in m²/s³: over a second each velocity changes by some 0.2 m/s.
    let motion = ConstantVelocity { spectral_density: 0.04 };
    let mean = Vector6::new(400.0, 300.0, 80.0, 0.0, 0.0, 0.0);
    let spread = Vector6::new(50.0, 50.0, 50.0, 10.0, 10.0, 10.0);
    let covariance = Covariance::from_diagonal(&spread.component_mul(&spread));
    let mut ekf = Ekf::new(motion, Differentiated(Radar), Estimate { mean, covariance })?;

    let mut truth = Vector6::new(430.0, 280.0, 110.0, -8.0, 4.0, -1.0);
    let sigmas = Vector3::new(5.0, 0.01, 0.01);
    for second in 1..=60_u8 {
        let noise = motion.noise_factor(&truth, 1.0) * Vector6::from_fn(|_, _| normal());
        truth = motion.propagate(&truth, 1.0) + noise;
        let receiver = Pose::at(0.0, f64::from(second), 2.0);
        let errors = Vector3::from_fn(|row, _| sigmas[row] * normal());
        let z = MeasurementModel::expected(&Differentiated(Radar), &truth, &receiver) + errors;
        let noise = Matrix3::from_diagonal(&sigmas.component_mul(&sigmas));
        ekf.predict(1.0)?;
        let _ = ekf.update(&Observation::new(f64::from(second), receiver, z, noise)?)?;
    }
    let estimate = ekf.estimate();
    let error = estimate.mean - truth;
    println!("place {:.1} m off, velocity {:.2} m/s off", norm(&error, 0), norm(&error, 3));
    println!("NEES {:.1} of 6 components", estimate.nees(&truth).ok_or("no NEES")?);
    assert!(norm(&error, 0) < 10.0 && norm(&error, 3) < 2.0);
    Ok(())
}

/// The length of three components from one on.
fn norm(error: &Vector6<f64>, first: usize) -> f64 {
    error.fixed_rows::<3>(first).norm()
}
