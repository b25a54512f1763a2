//! Consistency of a filter of one's own: its NEES over independent runs, and the whiteness of its
//! innovations. A filter whose q is too small by a factor of 100 fails both tests.
//!
//! `cargo run --example consistency`

#![expect(clippy::print_stdout, reason = "an example shows what it found")]

use foxhunt::{
    core::ConstantVelocity,
    filters::{
        Ekf,
        consistency::{ChiSquaredAverage, Monitored, Verdict, Whiteness},
    },
    nalgebra::{Matrix2, SMatrix, Vector2, Vector4},
    prelude::*,
};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

/// The place itself, as a GNSS receiver has it.
#[derive(Clone, Copy)]
struct Fix;

impl MeasurementModel<4, 2> for Fix {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::linear("east_m"), Quantity::linear("north_m")]
    }

    fn expected(&self, state: &Vector4<f64>, _receiver: &Pose) -> Vector2<f64> {
        state.fixed_rows::<2>(0).into_owned()
    }
}

const RUNS: u64 = 200;
const SIGMA: f64 = 2.0;
const Q: f64 = 0.01;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for (assumed, expected) in [(Q, Verdict::Consistent), (Q * Q, Verdict::OverConfident)] {
        let mut nees = ChiSquaredAverage::new(0.99)?;
        let mut whiteness = Whiteness::new(10);
        for seed in 0..RUNS {
            run(seed, assumed, &mut nees, &mut whiteness)?;
        }
        let [low, high] = nees.interval().ok_or("no run")?;
        let test = whiteness.ljung_box().ok_or("no innovation")?;
        println!(
            "q = {assumed}: NEES {:.2}, consistent in {low:.2} to {high:.2}: {}; white: p = {:.3}",
            nees.average().ok_or("no run")?,
            nees.verdict(),
            test.p_value,
        );
        assert_eq!(nees.verdict(), expected);
        assert_eq!(test.p_value > 0.001, expected == Verdict::Consistent);
    }
    Ok(())
}

/// One run whose truth is drawn from the prior and moves with q; its last NEES, as the errors of
/// one run hang together, and its innovations.
fn run(
    seed: u64,
    assumed: f64,
    nees: &mut ChiSquaredAverage,
    whiteness: &mut Whiteness,
) -> Result<(), Box<dyn std::error::Error>> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut normal = || rng.sample::<f64, _>(StandardNormal);
    let sigmas = Vector4::new(10.0, 10.0, 1.0, 1.0);
    let covariance = SMatrix::from_diagonal(&sigmas.component_mul(&sigmas));
    let prior = Estimate { mean: Vector4::zeros(), covariance };
    let motion = ConstantVelocity { spectral_density: Q };
    let filter = Ekf::new(ConstantVelocity { spectral_density: assumed }, Fix, prior)?;
    let mut filter = Monitored::new(filter, Fix);
    let mut truth = sigmas.map(|sigma| sigma * normal());
    for second in 1..=60_u8 {
        let noise = motion.noise_factor(&truth, 1.0) * Vector4::from_fn(|_, _| normal());
        truth = motion.propagate(&truth, 1.0) + noise;
        let z = Fix.expected(&truth, &Pose::default()) + Vector2::from_fn(|_, _| SIGMA * normal());
        let noise = Matrix2::identity() * (SIGMA * SIGMA);
        filter.predict(1.0)?;
        let _ = filter.update(&Observation::new(f64::from(second), Pose::default(), z, noise)?)?;
    }
    nees.add(filter.estimate().nees(&truth).ok_or("no NEES")?, 4);
    whiteness.add_run(filter.innovations());
    Ok(())
}
