//! One prediction and one update of every estimator of the library's parts, in the middle of a
//! search.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use foxhunt::prelude::*;

#[path = "problems/reception.rs"]
mod reception;

fn updates(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("predict and update");
    for entry in Registry::builtin().estimators() {
        let Some(estimator) = reception::in_the_middle(entry) else { continue };
        let next = reception::observation(12);
        group.bench_function(&*entry.name, |bencher| {
            bencher.iter_batched(
                || estimator.clone(),
                |mut estimator| {
                    reception::receive(&mut estimator, black_box(&next));
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
