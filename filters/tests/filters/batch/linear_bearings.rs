//! The closed forms: what they cost, and what takes their bias off.

use foxhunt_core::Estimate;
use foxhunt_filters::{BatchError, BearingLine, instrumental_variables, pseudolinear, stansfield};
use nalgebra::{Matrix2, Vector2};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

const PLACE: Vector2<f64> = Vector2::new(30.0, 250.0);
const SIGMA: f64 = 0.07;

/// Bearings from 30 receivers along a leg of 300 m, from which the target lies 250 m off.
fn simulate(rng: &mut Xoshiro256PlusPlus, sigma: f64) -> Vec<(BearingLine, f64)> {
    let line = |i: u8| {
        let receiver = Vector2::new(-150.0 + 10.0 * f64::from(i), 0.0);
        let way = PLACE - receiver;
        let noise: f64 = rng.sample(StandardNormal);
        let bearing = way.y.atan2(way.x) + sigma * noise;
        (BearingLine { receiver, bearing }, SIGMA)
    };
    (0..30).map(line).collect()
}

/// The trace of the Cramér-Rao bound.
fn bound() -> f64 {
    let mut information = Matrix2::zeros();
    for (line, sigma) in simulate(&mut Xoshiro256PlusPlus::seed_from_u64(0), 0.0) {
        let way = PLACE - line.receiver;
        let slope = Vector2::new(-way.y, way.x) / way.norm_squared() / sigma;
        information += slope * slope.transpose();
    }
    information.cholesky().expect("definite").inverse().trace()
}

type ClosedForm = fn(&[(BearingLine, f64)]) -> Result<Estimate<2>, BatchError>;

/// The mean error's norm, its standard error, and the mean squared error over the bound.
fn statistics(estimator: ClosedForm, seed: u64) -> (f64, f64, f64) {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let runs = 4000_u16;
    let mut sum = Vector2::zeros();
    let mut square = 0.0;
    for _ in 0..runs {
        let error = estimator(&simulate(&mut rng, SIGMA)).expect("a fix").mean - PLACE;
        sum += error;
        square += error.norm_squared();
    }
    let n = f64::from(runs);
    ((sum / n).norm(), (square / n / n).sqrt(), square / n / bound())
}

/// Seed 91, 4000 runs. The bias is judged at 3.3 standard errors, one false alarm in 1000.
#[test]
fn instruments_take_the_bias_off() {
    let (plain, plain_error, plain_square) = statistics(pseudolinear, 91);
    let (weighed, weighed_error, weighed_square) = statistics(stansfield, 91);
    let (clean, clean_error, clean_square) = statistics(instrumental_variables, 91);
    println!("pseudolinear bias {plain:.2} ± {plain_error:.2} m, {plain_square:.3} of the bound");
    println!("Stansfield {weighed:.2} ± {weighed_error:.2} m, {weighed_square:.3}");
    println!("instruments {clean:.2} ± {clean_error:.2} m, {clean_square:.3}");
    assert!(plain > 10.0 * plain_error && weighed > 10.0 * weighed_error);
    // What is left is of second order in the noise.
    assert!(clean < 0.2 * weighed, "{clean} of {weighed}");
    assert!(clean_square < 1.15 && clean_square < weighed_square && clean_square < plain_square);
}

/// Without noise all three are exact.
#[test]
fn exact_bearings_give_the_place() {
    let exact = simulate(&mut Xoshiro256PlusPlus::seed_from_u64(92), 0.0);
    let estimators: [ClosedForm; 3] = [pseudolinear, stansfield, instrumental_variables];
    for estimator in estimators {
        let fix = estimator(&exact).expect("a fix");
        assert!((fix.mean - PLACE).norm() < 1e-9);
        assert!((fix.covariance.trace() / bound() - 1.0).abs() < 1e-9);
    }
}

#[test]
fn lines_without_a_place_are_refused() {
    let line = |east: f64, bearing: f64, sigma: f64| {
        (BearingLine { receiver: Vector2::new(east, 0.0), bearing }, sigma)
    };
    let estimators: [ClosedForm; 3] = [pseudolinear, stansfield, instrumental_variables];
    for estimator in estimators {
        let parallel = [line(0.0, 1.0, 0.1), line(9.0, 1.0, 0.1)];
        assert!(matches!(estimator(&parallel), Err(BatchError::Flat { .. })));
        let one = [line(0.0, 1.0, 0.1)];
        assert!(matches!(estimator(&one), Err(BatchError::TooFew { have: 1, need: 2, .. })));
        let behind = [line(0.0, 2.0, 0.1), line(9.0, 1.0, 0.1)];
        assert!(matches!(estimator(&behind), Err(BatchError::Contradiction { .. })));
        for sigma in [0.0, f64::NAN] {
            let bad = [line(0.0, 1.0, 0.1), line(9.0, 2.0, sigma)];
            assert!(matches!(estimator(&bad), Err(BatchError::Value { index: 1, .. })));
        }
    }
}
