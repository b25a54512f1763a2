//! One step of a cloud on a problem of bearings, everything included, beside the loop that one
//! would write instead.
//!
//! `STEPS=100 SCHEME=multinomial WHAT=columns PARTICLES=10000` takes that many steps and measures
//! nothing, for a tool that counts instructions; `WHAT` may also be `threads`, `states` or `loop`.

use std::{env, hint::black_box};

use bearings::{Step, columns, observations, steps};
use criterion::{BenchmarkId, Criterion, Throughput};
use foxhunt_core::{Observation, State};
use foxhunt_filters::Resampling;

mod bearings;

/// Also by columns on all threads.
fn of(what: &str, scheme: Resampling, particles: usize, seed: u64) -> Step {
    match what {
        "threads" => steps(columns(scheme, particles, seed).with_threads()),
        _ => bearings::of(what, scheme, particles, seed),
    }
}

/// That all of them are the same filter: mean and variances after 20 steps, from 100 seeds. 4.5
/// standard errors: a false alarm of the 32 in 4500 seeds.
fn agree(observations: &[Observation<1>]) {
    for scheme in [Resampling::Multinomial, Resampling::Systematic] {
        let moments = |what| {
            let mut sums = State::<8>::zeros();
            let mut squares = State::<8>::zeros();
            for seed in 0..100 {
                let mut step = of(what, scheme, 1000, seed);
                let last = observations[..20].iter().map(&mut step).last().expect("some");
                let at = |i| if i < 4 { last.mean[i] } else { last.covariance[(i - 4, i - 4)] };
                let reported = State::<8>::from_fn(|i, _| at(i));
                sums += reported / 100.0;
                squares += reported.component_mul(&reported) / 100.0;
            }
            (sums, (squares - sums.component_mul(&sums)) / 99.0)
        };
        let (mean, variance) = moments("loop");
        for what in ["columns", "states"] {
            let (other, spread) = moments(what);
            for i in 0..8 {
                let error = (variance[i] + spread[i]).sqrt();
                let off = (other[i] - mean[i]).abs();
                assert!(off < 4.5 * error, "{what}, {scheme:?}, {i}: {off} with {error}");
            }
        }
    }
}

fn main() {
    let observations = observations();
    let set = |name: &str| env::var(name).ok();
    if let Some(steps) = set("STEPS").and_then(|steps| steps.parse().ok()) {
        let scheme = match set("SCHEME").as_deref() {
            Some("multinomial") => Resampling::Multinomial,
            _ => Resampling::Systematic,
        };
        let particles = set("PARTICLES").and_then(|count| count.parse().ok()).unwrap_or(10_000);
        let mut step = of(set("WHAT").as_deref().unwrap_or("columns"), scheme, particles, 1);
        for observation in observations.iter().cycle().take(steps) {
            black_box(step(observation));
        }
        return;
    }
    agree(&observations);
    let mut criterion = Criterion::default().configure_from_args();
    for scheme in [Resampling::Multinomial, Resampling::Systematic] {
        let mut group = criterion.benchmark_group(format!("{scheme:?}"));
        for particles in [1000, 10_000, 100_000, 1_000_000] {
            group.throughput(Throughput::Elements(particles));
            group.sample_size(if particles > 10_000 { 10 } else { 50 });
            for what in ["loop", "columns", "threads", "states"] {
                let mut step = of(what, scheme, usize::try_from(particles).expect("few"), 1);
                let mut observation = observations.iter().cycle();
                group.bench_function(BenchmarkId::new(what, particles), |bencher| {
                    bencher.iter(|| step(observation.next().expect("endless")));
                });
            }
        }
        group.finish();
    }
    criterion.final_summary();
}
