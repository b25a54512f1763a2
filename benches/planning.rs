//! One plan for eight drones from a belief of 2000 particles, against steepest descent and an
//! exhaustive search for the next turn alone.

use std::hint::black_box;

use belief::{Cloud, drones};
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use foxhunt::{
    formation::{
        self, Information, InformationConfig, Polygon, SteepestDescent, SteepestDescentConfig,
        TurnInformation,
    },
    prelude::*,
};
use nalgebra::{Matrix2, Vector2, Vector3};

#[path = "problems/belief.rs"]
mod belief;

/// The best polygon of 21 × 21 centres, 8 radii and 3 rotations by the expected log-determinant of
/// the next turn, over the first 64 particles.
fn exhaustive(turn: &impl TurnInformation, belief: &Cloud, drones: usize) -> (f64, Vector2<f64>) {
    let prior = belief.moments.covariance.try_inverse().expect("it is definite");
    let sigma = (0.5 * belief.moments.covariance.trace()).sqrt();
    let mut best = (f64::NEG_INFINITY, Vector2::zeros());
    for cell in 0..21 * 21_u32 {
        let grid = Vector2::new(f64::from(cell % 21) - 10.0, f64::from(cell / 21) - 10.0);
        let centre = belief.moments.mean + grid * (0.2 * sigma);
        for (radius, turned) in
            (1..=8).flat_map(|r| (0..3).map(move |t| (f64::from(r), f64::from(t))))
        {
            let polygon = Polygon { circumradius: 0.25 * sigma * radius };
            let places: Vec<Vector3<f64>> = (0..drones)
                .map(|i| polygon.vertex(&centre, 0.26 * turned, 3.0, i, drones))
                .collect();
            let nats: f64 = belief.places[..64]
                .iter()
                .map(|target| {
                    let reported: Matrix2<f64> =
                        places.iter().map(|place| turn.fisher(target, place).total()).sum();
                    (prior + reported).determinant().ln()
                })
                .sum();
            if nats > best.0 {
                best = (nats, centre);
            }
        }
    }
    best
}

/// One plan, which must be one: a search that is over returns at once.
fn listens(planner: &mut impl FormationPlanner, belief: &Cloud, stations: &mut [Station]) {
    let decision = planner.plan(black_box(belief), stations);
    assert!(matches!(decision, Ok(Decision::Listen(_))), "{decision:?}");
}

fn planning(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("one plan for 8 drones");
    group.sample_size(20);
    let drones = drones();
    let config = InformationConfig::default();
    for (name, belief) in [
        ("one mode", Cloud::about(&[[20.0, 30.0]], 15.0)),
        ("two modes", Cloud::about(&[[-40.0, 30.0], [60.0, 10.0]], 8.0)),
    ] {
        for (criterion, horizon) in [
            (formation::Criterion::Automatic, 3),
            (formation::Criterion::Automatic, 8),
            (formation::Criterion::Entropy, 3),
            (formation::Criterion::Entropy, 8),
        ] {
            let config = InformationConfig { criterion, horizon, ..config };
            let information = Information::new(config).expect("in range");
            let name = format!("information, {criterion:?}, horizon {horizon}, {name}");
            group.bench_function(name, |bencher| {
                // A new search each time: one that goes on meets its cap, and plans nothing more.
                bencher.iter_batched(
                    || (information.clone(), drones.clone()),
                    |(mut planner, mut stations)| listens(&mut planner, &belief, &mut stations),
                    BatchSize::SmallInput,
                );
            });
        }
        let descent = SteepestDescent::new(SteepestDescentConfig::default()).expect("in range");
        group.bench_function(format!("steepest descent, {name}"), |bencher| {
            bencher.iter_batched(
                || (descent.clone(), drones.clone()),
                |(mut planner, mut stations)| listens(&mut planner, &belief, &mut stations),
                BatchSize::SmallInput,
            );
        });
        let turn = config.turn().expect("in range");
        group.bench_function(format!("exhaustive, one turn, {name}"), |bencher| {
            bencher.iter(|| exhaustive(&turn, black_box(&belief), drones.len()));
        });
    }
    group.finish();
}

criterion_group!(benches, planning);
criterion_main!(benches);
