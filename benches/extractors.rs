//! Every extractor that has a name on one turn of 128 × 6 readings, clean and with a reflection.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use foxhunt::prelude::*;
use turn::turn;

#[path = "problems/turn.rs"]
mod turn;

fn turns(criterion: &mut Criterion) {
    for (what, reflected) in [("clean turn", 0.0), ("turn with a reflection", 0.5)] {
        let samples = turn(reflected);
        let sweep = Sweep { positions: 128, samples: &samples, ..Sweep::default() };
        let mut group = criterion.benchmark_group(what);
        let registry = Registry::builtin();
        for entry in registry.extractors() {
            let extractor = registry.build_extractor(&entry.config());
            let extractor = extractor.expect("its defaults are in range");
            group.bench_function(&*entry.name, |bencher| {
                bencher.iter(|| extractor.extract(black_box(&sweep)));
            });
        }
        group.finish();
    }
}

criterion_group!(benches, turns);
criterion_main!(benches);
