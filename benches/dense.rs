//! A dense covariance of n correlated levels, factored and solved for three right sides: nalgebra
//! beside faer, and the whole of [`independent_share`] for as many observations.

use approx::assert_abs_diff_eq;
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use faer::{
    Mat, Side,
    linalg::solvers::{Llt, Solve},
};
use foxhunt_filters::independent_share;
use nalgebra::{DMatrix, Vector2};

/// Gudmundson's correlation over 30 m of a path with a reading each metre, a tenth of it noise.
fn correlation(i: usize, j: usize) -> f64 {
    let apart_m = f64::from(u32::try_from(i.abs_diff(j)).expect("few"));
    if i == j { 1.0 } else { 0.9 * (-apart_m / 30.0).exp() }
}

/// Three columns, as a fit of three parameters has.
fn slope(i: usize, j: usize) -> f64 {
    let along = f64::from(u32::try_from(i).expect("few")) * 0.01;
    along.powi(i32::try_from(j).expect("few"))
}

fn of_nalgebra(n: usize) -> f64 {
    let factor = DMatrix::from_fn(n, n, correlation).cholesky().expect("definite");
    factor.solve(&DMatrix::from_fn(n, 3, slope))[(n - 1, 0)]
}

fn of_faer(n: usize) -> f64 {
    let matrix = Mat::<f64>::from_fn(n, n, correlation);
    let factor = Llt::new(matrix.as_ref(), Side::Lower).expect("definite");
    factor.solve(Mat::<f64>::from_fn(n, 3, slope))[(n - 1, 0)]
}

fn shared(n: usize) -> f64 {
    let places = (0..n).map(|i| Vector2::new(slope(i, 1) * 100.0, 0.0));
    let residuals = (0..n).map(|i| (slope(i, 1) * 40.0).sin());
    let (places, residuals): (Vec<_>, Vec<_>) = places.zip(residuals).unzip();
    independent_share(&places, &residuals, &DMatrix::from_fn(n, 3, slope))
}

fn measure(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("dense");
    group.sample_size(20);
    for n in [16, 32, 64, 150, 300, 600] {
        assert_abs_diff_eq!(of_nalgebra(n), of_faer(n), epsilon = 1e-9);
        group.bench_function(BenchmarkId::new("nalgebra", n), |bencher| {
            bencher.iter(|| of_nalgebra(n));
        });
        group.bench_function(BenchmarkId::new("faer", n), |bencher| bencher.iter(|| of_faer(n)));
        group.bench_function(BenchmarkId::new("independent_share", n), |bencher| {
            bencher.iter(|| shared(n));
        });
    }
    group.finish();
}

criterion_group!(benches, measure);
criterion_main!(benches);
