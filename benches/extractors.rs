//! Every extractor that has a name on one turn of 128 × 6 readings, clean and with a reflection.

use std::{f64::consts::TAU, hint::black_box};

use criterion::{Criterion, criterion_group, criterion_main};
use foxhunt::{
    prelude::*,
    sensors::{Antenna, PatternTable},
};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{Distribution, StandardNormal};

/// A turn with 2 dB of noise and a reflection of so much of the direct amplitude.
fn turn(reflected: f64) -> Vec<Sample> {
    let antenna = PatternTable::reference_patch();
    let amplitude = |off: f64| 10.0_f64.powf(antenna.gain_dbi(off, 0.0) / 20.0);
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    let mut samples = Vec::new();
    for position in 0..128_u16 {
        let boresight = TAU * f64::from(position) / 128.0;
        let level = amplitude(1.0 - boresight) + reflected * amplitude(2.5 - boresight);
        for _ in 0..6 {
            let noise: f64 = StandardNormal.sample(&mut rng);
            let rss_dbm = 20.0 * level.log10() - 60.0 + 2.0 * noise;
            let receiver = Pose::default();
            samples.push(Sample { time: 0.0, receiver, boresight, position, rss_dbm });
        }
    }
    samples
}

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
