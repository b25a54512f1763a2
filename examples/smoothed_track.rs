//! A fox that stands and walks by turns, followed by its level and bearing: the track by the
//! receptions up to each time, and the smoothed one by all of them.
//!
//! `cargo run --example smoothed_track`

#![expect(clippy::print_stdout, reason = "an example shows what it found")]

use std::error::Error;

use foxhunt::{
    core::ConstantVelocity,
    filters::{Ckf, Imm, Remembering, Transition},
    prelude::*,
    sensors::{LogDistance, RssBearing},
};
use nalgebra::{Matrix2, Vector2, Vector4};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

/// Stands for 40 s, walks East at 1 m/s for 60 s, and stands again.
fn fox(second: f64) -> Vector2<f64> {
    Vector2::new((second - 40.0).clamp(0.0, 60.0) - 30.0, 12.0)
}

fn main() -> Result<(), Box<dyn Error>> {
    let model = RssBearing::new(LogDistance::new(-29.06, 2.765)?);
    let mut prior = Estimate::isotropic(Vector4::zeros(), 0.5);
    (0..2).for_each(|i| prior.covariance[(i, i)] = 400.0);
    let standing = RandomWalk { drift: Vector4::new(0.05, 0.05, 0.2, 0.2) };
    let walking = ConstantVelocity { spectral_density: 0.04 };
    let motions: [&dyn MotionModel<4>; 2] = [&standing, &walking];
    let mut modes = Vec::new();
    for motion in motions {
        modes.push((0.5, Ckf::new(motion, model, prior)?));
    }
    let imm = Imm::<_, 4, 2>::new(modes, Transition::sojourn(&[40.0, 40.0])?)?;
    let mut imm = Remembering::new(imm);

    let mut rng = Xoshiro256PlusPlus::seed_from_u64(48);
    let mut filtered = Vec::new();
    for second in (0..140_u32).step_by(2).map(f64::from) {
        // One drone circles over the field.
        let around = 0.1 * second;
        let drone = Pose::at(45.0 * around.cos(), 45.0 * around.sin(), 10.0);
        let state = Vector4::new(fox(second).x, fox(second).y, 0.0, 0.0);
        let noise = Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        let sigma = Vector2::new(3.0, 0.15);
        let value = model.expected(&state, &drone) + noise.component_mul(&sigma);
        let noise = Matrix2::from_diagonal(&sigma.component_mul(&sigma));
        imm.predict(if second > 0.0 { 2.0 } else { 0.0 })?;
        let _ = imm.update(&Observation::new(second, drone, value, noise)?)?;
        filtered.push(imm.estimate());
    }

    println!("time   filtered: error, σ   smoothed: error, σ   walks with");
    let mut squares = [0.0; 2];
    let smoothed = imm.smoothed()?;
    for (number, (before, (second, after))) in filtered.iter().zip(&smoothed).enumerate() {
        let off = |estimate: &Estimate<4>| (estimate.mean.xy() - fox(*second)).norm();
        let sigma = |estimate: &Estimate<4>| estimate.position().covariance.trace().sqrt();
        let both = [*before, after.estimate()];
        squares.iter_mut().zip(&both).for_each(|(sum, one)| *sum += off(one).powi(2));
        if number % 5 == 0 {
            let [f, s] = both.map(|one| format!("{:6.2} m, {:5.2} m", off(&one), sigma(&one)));
            let walks = after.probabilities().nth(1).unwrap_or(0.0);
            println!("{second:4} s   {f}      {s}      {walks:.2}");
        }
    }
    let count = f64::from(u32::try_from(smoothed.len())?);
    let [f, s] = squares.map(|sum| (sum / count).sqrt());
    println!("root mean square error: filtered {f:.2} m, smoothed {s:.2} m");
    assert!(s < f, "all receptions know more than the earlier ones");
    Ok(())
}
