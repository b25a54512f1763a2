//! One prediction and one update of every estimator of the library's parts, in the middle of a
//! search.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use foxhunt::{config::ModelConfig, prelude::*};
use nalgebra::{Matrix2, Vector2};

/// The observation of a drone on its place of a triangle about the beacon.
fn observation(turn: u32) -> Observation<2> {
    let around = 2.1 * f64::from(turn);
    let receiver = Pose::at(6.0 * around.cos(), 6.0 * around.sin(), 4.0);
    let value = Vector2::new(-53.0 + 3.0 * (3.0 * around).sin(), around + 3.3);
    let noise = Matrix2::from_diagonal(&Vector2::new(62.0, 0.27));
    Observation::new(30.0 * f64::from(turn), receiver, value, noise).expect("plain numbers")
}

fn updates(criterion: &mut Criterion) {
    let model = ModelConfig {
        reference_dbm: -29.06,
        exponent: 2.765,
        target_up_m: 0.0,
        antenna: None,
        reference_m: None,
    };
    let model = model.build().expect("in range");
    let prior = Estimate::isotropic(Vector2::new(3.0, -2.0), 50.0);
    let mut group = criterion.benchmark_group("predict and update");
    for entry in Registry::builtin().estimators() {
        let Some(settings) = entry.settings() else { continue };
        let mut estimator = settings.build(model.clone(), &prior, 1).expect("a proper prior");
        for turn in 0..12 {
            estimator.predict(30.0).expect("a proper step");
            let _ = estimator.update(&observation(turn)).expect("possible");
        }
        let next = observation(12);
        group.bench_function(&*entry.name, |bencher| {
            bencher.iter_batched(
                || estimator.clone(),
                |mut estimator| {
                    estimator.predict(black_box(30.0)).expect("a proper step");
                    let _ = estimator.update(black_box(&next)).expect("possible");
                    estimator
                },
                BatchSize::SmallInput,
            );
        });
    }
    group.finish();
}

criterion_group!(benches, updates);
criterion_main!(benches);
