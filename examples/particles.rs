//! A particle filter with a generator by name, over bearings from one receiver, whose belief is no
//! Gaussian.
//!
//! `cargo run --example particles`

#![expect(clippy::print_stdout, reason = "an example shows what it found")]

use foxhunt::{
    filters::ParticleFilter,
    nalgebra::{Matrix1, Vector1, Vector2},
    prelude::*,
    sensors::BearingOnly,
};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let prior = Estimate::isotropic(Vector2::zeros(), 50.0);
    let walk = RandomWalk::uniform(0.1);

    // Xoshiro256PlusPlus gives the same numbers in every release of rand and on every processor,
    // so the run can be repeated anywhere; filters over it can be cloned. Any other generator of
    // rand will do, StdRng too: with other numbers in a later release, and without clones.
    let rng = Xoshiro256PlusPlus::seed_from_u64(7);
    let mut cloud = ParticleFilter::new(walk, BearingOnly::new(), prior, 5000, rng)?;

    let beacon = Vector2::new(40.0, 25.0);
    for second in 0..20_u8 {
        let receiver = Pose::at(-60.0 + 4.0 * f64::from(second), -30.0, 0.0);
        let way = beacon - receiver.position.xy();
        let bearing = Vector1::new(way.y.atan2(way.x));
        let observation =
            Observation::new(f64::from(second), receiver, bearing, Matrix1::new(0.01))?;
        cloud.predict(1.0)?;
        let _ = cloud.update(&observation)?;
        if second == 0 {
            let long = cloud.estimate().ellipse(0.95).ok_or("no ellipse")?;
            println!("after one bearing: {:.0} m by {:.0} m", long.semi_major, long.semi_minor);
        }
    }
    let error = (cloud.estimate().mean - beacon).norm();
    println!("after twenty: {error:.1} m off, {:.0} of 5000", cloud.effective_sample_size());
    assert!(error < 10.0);
    // What a belief of any shape is: weighted states.
    let mut beyond = 0.0;
    cloud.visit_samples(&mut |state, weight| {
        if (state - beacon).norm() > 10.0 {
            beyond += weight;
        }
    });
    println!("{:.1} % of the belief is more than 10 m away", 100.0 * beyond);
    Ok(())
}
