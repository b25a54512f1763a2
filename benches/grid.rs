//! One reception of a grid, prediction included: level and bearing of a still target from three
//! drones that fly round it, the models behind pointers as in a hunt.
//!
//! `STEPS=60 WHAT=doubted SIDE=64` takes that many steps and measures nothing, for a tool that
//! counts instructions; `WHAT` may also be `plain`.

use std::{env, hint::black_box, sync::Arc};

use criterion::{BenchmarkId, Criterion};
use foxhunt_core::{
    Estimate, Estimator, MeasurementModel, MotionModel, Observation, Pose, RandomWalk, State,
    angle,
    nalgebra::{Matrix2, Vector2},
};
use foxhunt_filters::{GridConfig, GridFilter, NoiseScales};
use foxhunt_sensors::{FreePowerRssBearing, LogDistance, RssBearing};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

const POWER_DBM: f64 = -29.06;
const EXPONENT: f64 = 2.765;

/// Receptions by three drones, in turn, on their way round the target.
fn observations() -> Vec<Observation<2>> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(9);
    let mut white = move || rng.sample::<f64, _>(StandardNormal);
    let law = LogDistance::new(POWER_DBM + 4.0, EXPONENT).expect("in range");
    let truth = RssBearing::new(law);
    let observation = |step: u32| {
        let around = 2.1 * f64::from(step % 3) + 0.15 * f64::from(step / 3);
        let pose = Pose::at(5.0 + 25.0 * around.cos(), 20.0 * around.sin(), 10.0);
        let expected = truth.expected(&Vector2::new(12.0, -7.0), &pose);
        let noise = Matrix2::from_diagonal(&Vector2::new(16.0, 0.09));
        let z = expected + Vector2::new(6.0 * white(), 0.3 * white());
        let z = Vector2::new(z.x, angle::wrap(z.y));
        Observation::new(0.0, pose, z, noise).expect("proper")
    };
    (0..60).map(observation).collect()
}

/// A grid over a wide prior.
fn filter<const N: usize>(
    side: usize,
    model: Arc<dyn MeasurementModel<N, 2>>,
    noise_scales: Option<NoiseScales>,
) -> Box<dyn Estimator<N, 2>> {
    let motion: Arc<dyn MotionModel<N>> = Arc::new(RandomWalk::<N> { drift: State::repeat(0.02) });
    let mut prior = Estimate::isotropic(State::zeros(), 25.0);
    if N > 2 {
        prior.mean[2] = POWER_DBM;
        prior.covariance[(2, 2)] = 25.0;
    }
    let config =
        GridConfig { side, most_per_side: 2 * side, noise_scales, ..GridConfig::default() };
    Box::new(GridFilter::new(motion, model, prior, config).expect("proper"))
}

/// The level's noise as the program's estimator doubts it: factors e^(0.5 k) about 1.
fn doubts() -> NoiseScales {
    let node = |k: f64| ((0.5 * k).exp(), (-0.5 * k * k).exp());
    NoiseScales { component: 0, factors: [-1.5, -0.75, 0.0, 0.75, 1.5].map(node).to_vec() }
}

fn step<const N: usize>(grid: &mut dyn Estimator<N, 2>, observation: &Observation<2>) -> f64 {
    grid.predict(1.0).expect("a proper step");
    let _ = grid.update(observation).expect("possible");
    grid.estimate().mean[0]
}

/// A hunt: how far East the target is after each of its receptions.
fn hunt(what: &str, side: usize, observations: &[Observation<2>]) -> f64 {
    match what {
        "doubted" => {
            let model = FreePowerRssBearing::new(EXPONENT).expect("in range");
            let mut grid = filter::<3>(side, Arc::new(model), Some(doubts()));
            observations.iter().map(|o| step(&mut *grid, o)).last().expect("some")
        }
        "plain" => {
            let law = LogDistance::new(POWER_DBM, EXPONENT).expect("in range");
            let mut grid = filter::<2>(side, Arc::new(RssBearing::new(law)), None);
            observations.iter().map(|o| step(&mut *grid, o)).last().expect("some")
        }
        other => panic!("no {other} to measure"),
    }
}

#[expect(clippy::print_stdout, reason = "two runs shall be comparable")]
fn main() {
    let observations = observations();
    let set = |name: &str| env::var(name).ok();
    if let Some(steps) = set("STEPS").and_then(|steps| steps.parse().ok()) {
        let side = set("SIDE").and_then(|side| side.parse().ok()).unwrap_or(64);
        let what = set("WHAT").unwrap_or_else(|| "doubted".into());
        println!("{:.9}", black_box(hunt(&what, side, &observations[..steps])));
        return;
    }
    let mut criterion = Criterion::default().configure_from_args();
    let mut group = criterion.benchmark_group("hunt of 60 receptions on a grid");
    group.sample_size(10);
    for (what, side) in [("doubted", 64), ("plain", 64), ("doubted", 400), ("plain", 400)] {
        group.bench_function(BenchmarkId::new(what, side), |bencher| {
            bencher.iter(|| hunt(what, side, &observations));
        });
    }
    group.finish();
    criterion.final_summary();
}
