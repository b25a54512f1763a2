//! A flight through the recursive batch estimator, and one fix from all observations at once:
//! level and bearing of a still target from a drone on a circle.
//!
//! `STEPS=1000 WHAT=flight` makes one and measures nothing, for a tool that counts instructions;
//! `WHAT` may also be `fix`.

use std::{env, hint::black_box};

use criterion::{BenchmarkId, Criterion, Throughput};
use foxhunt_core::{
    Estimate, Estimator, MeasurementModel, Observation, Pose, RandomWalk, State,
    nalgebra::{Matrix2, Vector2},
};
use foxhunt_filters::{BatchEstimator, BatchSolver};
use foxhunt_sensors::{LogDistance, RssBearing};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

const SIGMA_DB: f64 = 4.0;
const SIGMA_RAD: f64 = 0.2;

fn model() -> RssBearing<LogDistance> {
    RssBearing::new(LogDistance::pritzl2018_field())
}

fn prior() -> Estimate<2> {
    Estimate::isotropic(Vector2::zeros(), 50.0)
}

fn observations(count: u32) -> Vec<Observation<2>> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    let truth = Vector2::new(31.0, -17.0);
    let mut white = || -> State<2> { State::from_fn(|_, _| rng.sample(StandardNormal)) };
    let sigmas = Vector2::new(SIGMA_DB, SIGMA_RAD);
    let noise = Matrix2::from_diagonal(&sigmas.component_mul(&sigmas));
    let mut observe = |step: u32| {
        let around = 0.1 * f64::from(step);
        let receiver = Pose::at(60.0 * around.cos(), 60.0 * around.sin(), 20.0);
        let z = model().expected(&truth, &receiver) + sigmas.component_mul(&white());
        Observation::new(f64::from(step), receiver, z, noise).expect("finite")
    };
    (0..count).map(&mut observe).collect()
}

fn flight(observations: &[Observation<2>]) -> Estimate<2> {
    let still = RandomWalk::uniform(0.0);
    let mut estimator = BatchEstimator::new(still, model(), prior()).expect("a proper prior");
    let mut last = prior();
    for observation in observations {
        estimator.predict(1.0).expect("a proper step");
        let _ = estimator.update(observation).expect("possible");
        last = estimator.estimate();
    }
    last
}

fn fix(observations: &[Observation<2>]) -> Estimate<2> {
    let solver = BatchSolver::new(model()).with_prior(prior()).expect("a proper prior");
    solver.solve(observations, &[]).expect("an optimum").estimate
}

fn measure(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("batch");
    group.sample_size(10);
    for count in [100, 1_000, 10_000] {
        let observations = observations(count);
        group.throughput(Throughput::Elements(count.into()));
        group.bench_function(BenchmarkId::new("flight", count), |bencher| {
            bencher.iter(|| flight(black_box(&observations)));
        });
        group.bench_function(BenchmarkId::new("fix", count), |bencher| {
            bencher.iter(|| fix(black_box(&observations)));
        });
    }
    group.finish();
}

fn main() {
    let number = |name: &str| env::var(name).ok().and_then(|number| number.parse::<u32>().ok());
    if let Some(steps) = number("STEPS") {
        let observations = observations(steps);
        black_box(match env::var("WHAT").as_deref() {
            Ok("fix") => fix(&observations),
            _ => flight(&observations),
        });
        return;
    }
    let mut criterion = Criterion::default().configure_from_args();
    measure(&mut criterion);
    criterion.final_summary();
}
