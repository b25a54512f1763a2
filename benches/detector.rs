//! A second of samples at the rates of receivers, with 50 tags at the highest: what is taken of a
//! core is the time of one iteration over a second.
#![expect(clippy::cast_precision_loss, reason = "counts of samples are small")]

use std::{f32::consts::TAU, hint::black_box};

use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use foxhunt_signal::Complex32;
use foxhunt_signal::detector::{Detector, DetectorConfig};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{Distribution, StandardNormal};

/// A second of noise with a pulse of 20 ms and 35 dB of each tag.
fn second(rate: usize, tags: usize) -> Vec<Complex32> {
    let mut generator = Xoshiro256PlusPlus::seed_from_u64(1);
    let mut part = || -> f32 { StandardNormal.sample(&mut generator) };
    let mut samples: Vec<_> = (0..rate).map(|_| Complex32::new(part(), part())).collect();
    let length = rate / 50;
    let amplitude = (2.0 * 10f32.powf(3.5) / length as f32).sqrt();
    for _ in 0..tags {
        let start = generator.random_range(0..rate - length);
        let turns = generator.random_range(-0.45..0.45_f32);
        for n in 0..length {
            let angle = TAU * (turns * n as f32).fract();
            samples[start + n] += Complex32::from_polar(amplitude, angle);
        }
    }
    samples
}

fn seconds(criterion: &mut Criterion) {
    let bank = vec![2.5e-3, 5e-3, 10e-3, 20e-3, 40e-3];
    let cases = [
        ("2.4 MS/s, 50 tags, five widths", 2_400_000, 50, bank.clone()),
        ("2.4 MS/s, 50 tags, 20 ms", 2_400_000, 50, vec![20e-3]),
        ("250 kS/s, 5 tags, five widths", 250_000, 5, bank),
    ];
    let mut group = criterion.benchmark_group("a second of samples");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    for (name, rate, tags, widths_s) in cases {
        let samples = second(rate, tags);
        let mut config = DetectorConfig::new(rate as f64);
        config.widths_s = widths_s;
        let mut detector = Detector::new(config).expect("it is in order");
        let mut index = 0;
        let mut found = Vec::new();
        group.throughput(Throughput::Elements(rate as u64));
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                found.clear();
                for chunk in samples.chunks(1 << 14) {
                    detector.push(index, chunk, &mut found).expect("they are in order");
                    index += chunk.len() as u64;
                }
                black_box(&found);
            });
        });
    }
    group.finish();
}

criterion_group!(benches, seconds);
criterion_main!(benches);
