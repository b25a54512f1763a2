//! One reception of a grid, prediction included: level and bearing of a still target from three
//! drones that fly round it, the models behind pointers as in a hunt.
//!
//! `STEPS=60 WHAT=doubted SIDE=64` takes that many steps and measures nothing, for a tool that
//! counts instructions; `WHAT` may also be `plain`.

use core::{
    f64::consts::{LN_10, PI, TAU},
    hint::black_box,
};
use std::{env, sync::Arc};

use criterion::{BenchmarkId, Criterion};
use foxhunt_core::{
    Estimate, Estimator, MeasurementModel, MotionModel, Observation, Pose, Quantity, RandomWalk,
    State, angle, elementary,
    nalgebra::{Matrix2, SMatrix, Vector2, Vector3},
};
use foxhunt_filters::{GridConfig, GridFilter, NoiseScales};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

const POWER_DBM: f64 = -29.06;
const LOSS: f64 = 27.65;

/// Level and bearing; a third component of the state is the reference power.
struct LevelBearing;

/// What is measured of a target at this place, with this power.
fn measured(east: f64, north: f64, power: f64, receiver: &Pose) -> Vector2<f64> {
    let place = receiver.position;
    let (x, y) = (east - place.x, north - place.y);
    let square = x * x + y * y + place.z * place.z;
    Vector2::new(power - 0.5 * LOSS / LN_10 * libm::log(square), libm::atan2(y, x))
}

impl<const N: usize> MeasurementModel<N, 2> for LevelBearing {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::RSS, Quantity::BEARING]
    }
    fn expected(&self, target: &State<N>, receiver: &Pose) -> Vector2<f64> {
        let power = if N > 2 { target[2] } else { POWER_DBM };
        measured(target[0], target[1], power, receiver)
    }
    fn jacobian(&self, target: &State<N>, receiver: &Pose) -> SMatrix<f64, 2, N> {
        let place = receiver.position;
        let (x, y) = (target[0] - place.x, target[1] - place.y);
        let flat = x * x + y * y;
        let slope = -LOSS / LN_10 / (flat + place.z * place.z);
        let mut jacobian = SMatrix::zeros();
        [jacobian[(0, 0)], jacobian[(0, 1)]] = [slope * x, slope * y];
        [jacobian[(1, 0)], jacobian[(1, 1)]] = [-y / flat, x / flat];
        if N > 2 {
            jacobian[(0, 2)] = 1.0;
        }
        jacobian
    }
    fn log_likelihoods(&self, columns: [&[f64]; N], observation: &Observation<2>, out: &mut [f64]) {
        let (receiver, z) = (observation.receiver().position, observation.value());
        let noise = observation.noise();
        let constant = observation.log_density(&Vector2::zeros());
        let [weight_rss, weight_bearing] = [0, 1].map(|i| -0.5 / noise[(i, i)]);
        for (i, out) in out.iter_mut().enumerate() {
            let power = if N > 2 { columns[2][i] } else { POWER_DBM };
            let [level, bearing] = off(z, [columns[0][i], columns[1][i], power], receiver);
            *out = constant + weight_rss * level * level + weight_bearing * bearing * bearing;
        }
    }
    fn residuals(
        &self,
        columns: [&[f64]; N],
        z: &Vector2<f64>,
        receiver: &Pose,
        [levels, bearings]: [&mut [f64]; 2],
    ) {
        for (i, (level, bearing)) in levels.iter_mut().zip(bearings).enumerate() {
            let power = if N > 2 { columns[2][i] } else { POWER_DBM };
            [*level, *bearing] = off(z, [columns[0][i], columns[1][i], power], receiver.position);
        }
    }
}

/// The residual of a level and a bearing, the latter from −π to π.
#[inline(always)]
fn off(z: &Vector2<f64>, [east, north, power]: [f64; 3], receiver: Vector3<f64>) -> [f64; 2] {
    let (x, y) = (east - receiver.x, north - receiver.y);
    let square = x * x + y * y + receiver.z * receiver.z;
    let turned = z.y - elementary::atan2(y, x);
    let turned = if turned > PI { turned - TAU } else { turned };
    let turned = if turned < -PI { turned + TAU } else { turned };
    [z.x - power + 0.5 * LOSS / LN_10 * elementary::ln(square), turned]
}

/// Receptions by three drones, in turn, on their way round the target.
fn observations() -> Vec<Observation<2>> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(9);
    let mut white = move || rng.sample::<f64, _>(StandardNormal);
    let observation = |step: u32| {
        let around = 2.1 * f64::from(step % 3) + 0.15 * f64::from(step / 3);
        let pose = Pose::at(5.0 + 25.0 * around.cos(), 20.0 * around.sin(), 10.0);
        let expected = measured(12.0, -7.0, POWER_DBM + 4.0, &pose);
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
    noise_scales: Option<NoiseScales>,
) -> Box<dyn Estimator<N, 2>> {
    let motion: Arc<dyn MotionModel<N>> = Arc::new(RandomWalk::<N> {
        drift: State::from_fn(|row, _| if row < 2 { 0.02 } else { 0.0 }),
    });
    let model: Arc<dyn MeasurementModel<N, 2>> = Arc::new(LevelBearing);
    let mut prior = Estimate::isotropic(State::zeros(), 25.0);
    if N > 2 {
        prior.mean[2] = POWER_DBM;
        prior.covariance[(2, 2)] = 25.0;
    }
    let config = GridConfig { side, most_per_side: 2 * side, noise_scales, area: None };
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
            let mut grid = filter::<3>(side, Some(doubts()));
            observations.iter().map(|o| step(&mut *grid, o)).last().expect("some")
        }
        "plain" => {
            let mut grid = filter::<2>(side, None);
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
