//! The worked example of Lenth 1981, table 2, and what it does not show; the closed forms, what
//! they cost, and what takes their bias off.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use std::path::PathBuf;

use foxhunt_core::{Ellipse, Estimate};
use foxhunt_filters::{
    BatchError, BearingLine, BearingWeights, Lenth1981, instrumental_variables, pseudolinear,
    repeated_median, stansfield,
};
use nalgebra::{Matrix2, Vector2};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// The target of the closed forms, and σ of its bearings in radians.
const PLACE: Vector2<f64> = Vector2::new(30.0, 250.0);
const SIGMA: f64 = 0.07;

type ClosedForm = fn(&[(BearingLine, f64)]) -> Result<Estimate<2>, BatchError>;

/// A CSV's rows after its header; `None`, and a printed line, where there is no such file.
#[expect(clippy::print_stdout, reason = "a skipped test must report it")]
fn rows(file: &str) -> Option<Vec<Vec<String>>> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/lenth1981");
    let path = PathBuf::from(folder).join(file);
    if !path.exists() {
        println!("skipped: no vectors at {}", path.display());
        return None;
    }
    let text = std::fs::read_to_string(path).expect("readable");
    let fields = |line: &str| line.split(',').map(str::to_owned).collect();
    Some(text.lines().skip(1).map(fields).collect())
}

fn number(field: &str) -> f64 {
    field.parse().expect("a number")
}

/// The eight bearings of the example.
fn bearings() -> Option<Vec<BearingLine>> {
    let line = |row: Vec<String>| BearingLine {
        receiver: Vector2::new(number(&row[1]), number(&row[2])),
        bearing: (90.0 - number(&row[3])).to_radians(),
    };
    Some(rows("bearings.csv")?.into_iter().map(line).collect())
}

#[test]
fn table_2_comes_out() {
    let (Some(all), Some(table)) = (bearings(), rows("published_table2.csv")) else { return };
    let mut seven = all.clone();
    seven.remove(5);
    assert_eq!(table.len(), 10);
    for row in table {
        let lines = if row[0] == "7" { &seven } else { &all };
        let even = Lenth1981::maximum_likelihood();
        let m = |weights| even.with_weights(weights).expect("in range").locate(lines);
        let median = || repeated_median(lines).expect("they cross");
        let position = match &*row[1] {
            "MLE" => even.locate(lines).expect("a fix").position,
            "H-1.5" => m(BearingWeights::Huber { c: 1.5 }).expect("a fix").position,
            "A-1.5" => m(BearingWeights::Andrews { c: 1.5 }).expect("a fix").position,
            "RMR" => median().position,
            "JRMR" => Estimate { mean: median().jackknife, ..median().position },
            other => panic!("what is {other}?"),
        };
        let se = position.covariance.diagonal().map(f64::sqrt);
        let correlation = position.covariance[(0, 1)] / (se.x * se.y);
        // Half a unit of the last digit printed. Huber's standard errors are another half off
        // (0.1525 for 0.152, 0.9444 for 0.945): the paper's iteration stopped earlier.
        let last = if row[1] == "H-1.5" { 0.001 } else { 0.0005 };
        for (found, printed, tolerance) in [
            (position.mean.x, &row[2], 0.005),
            (position.mean.y, &row[3], 0.005),
            (se.x, &row[5], last),
            (se.y, &row[6], last),
            (correlation, &row[7], 0.0005),
        ] {
            assert!((found - number(printed)).abs() <= tolerance, "{row:?}: {found} for {printed}");
        }
    }
}

#[test]
fn the_outlier_loses_its_weight() {
    let Some(all) = bearings() else { return };
    let andrews = BearingWeights::Andrews { c: 1.5 };
    let fix = Lenth1981::maximum_likelihood().with_weights(andrews).expect("in range");
    let fix = fix.locate(&all).expect("a fix");
    assert!(fix.weights[5] < 1e-12, "{:?}", fix.weights);
    assert!(fix.weights.iter().enumerate().all(|(i, w)| i == 5 || *w > 0.7));
    assert_abs_diff_eq!(fix.kappa, 431.0, epsilon = 0.5);
}

/// Bearings from a half circle of receivers about (60, 40) to a place, σ in radians.
fn simulate(rng: &mut Xoshiro256PlusPlus, place: Vector2<f64>, sigma: f64) -> Vec<BearingLine> {
    let line = |i: u8| {
        let at = 0.4 * f64::from(i);
        let receiver = Vector2::new(60.0 + 80.0 * at.cos(), 40.0 + 80.0 * at.sin());
        let way = place - receiver;
        let noise: f64 = rng.sample(StandardNormal);
        BearingLine { receiver, bearing: way.y.atan2(way.x) + sigma * noise }
    };
    (0..10).map(line).collect()
}

/// Seed 81, 2000 runs; with κ known the NEES is χ² of 2 degrees, the band leaves out 0.1 %.
#[test]
fn the_covariance_with_known_kappa_is_consistent() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(81);
    let runs = 2000_u16;
    let sigma = 0.05;
    let estimator = Lenth1981::maximum_likelihood().with_kappa(1.0 / (sigma * sigma));
    let estimator = estimator.expect("positive");
    let mut sum = 0.0;
    for _ in 0..runs {
        let place = Vector2::new(50.0 + 20.0 * rng.random::<f64>(), 40.0 * rng.random::<f64>());
        let fix = estimator.locate(&simulate(&mut rng, place, sigma)).expect("a fix");
        sum += fix.position.nees(&place).expect("definite");
    }
    let law = ChiSquared::new(2.0 * f64::from(runs)).expect("positive");
    let [low, high] = [0.0005, 0.9995].map(|p| law.inverse_cdf(p));
    println!("ANEES {}", sum / f64::from(runs));
    assert!((low..high).contains(&sum), "{sum} is not in {low}..{high}");
}

#[test]
fn a_frame_far_from_its_origin_changes_nothing() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(82);
    let lines = simulate(&mut rng, Vector2::new(70.0, 30.0), 0.05);
    let here = Lenth1981::maximum_likelihood().locate(&lines).expect("a fix");
    let away = Vector2::new(5e5, -3e6);
    let moved: Vec<_> =
        lines.iter().map(|l| BearingLine { receiver: l.receiver + away, ..*l }).collect();
    let there = Lenth1981::maximum_likelihood().locate(&moved).expect("a fix");
    assert!((there.position.mean - away - here.position.mean).norm() < 1e-6);
    assert!((there.position.covariance - here.position.covariance).norm() < 1e-6);
}

#[test]
fn it_settles_in_coordinates_of_any_origin_and_scale() {
    // As in UTM: a northing of 5 300 km, and receivers metres, kilometres or centimetres apart.
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(84);
    for run in 0..100 {
        let lines = simulate(&mut rng, Vector2::new(70.0, 30.0), 0.05);
        let here = Lenth1981::maximum_likelihood().locate(&lines).expect("a fix");
        for scale in [1e-2, 1.0, 1e3] {
            let origin = Vector2::new(456_789.25, 5_312_345.75);
            let moved = |l: &BearingLine| BearingLine {
                receiver: origin + l.receiver * scale,
                bearing: l.bearing,
            };
            let moved: Vec<_> = lines.iter().map(moved).collect();
            let there = Lenth1981::maximum_likelihood().locate(&moved);
            let there = there.unwrap_or_else(|e| panic!("run {run}, scale {scale}: {e}"));
            // A coordinate of 5.3e6 has steps of 1e-9.
            let error = (there.position.mean - origin) / scale - here.position.mean;
            assert!(error.norm() < 1e-8 + 1e-7 / scale, "{error}");
            let covariance = there.position.covariance / (scale * scale);
            let error = (covariance - here.position.covariance).norm();
            assert!(error < (1e-6 + 1e-7 / scale) * here.position.covariance.norm(), "{error}");
        }
    }
}

/// Returns true if a place is in an ellipse.
fn holds(ellipse: &Ellipse, centre: &Vector2<f64>, place: &Vector2<f64>) -> bool {
    let (sin, cos) = ellipse.orientation.sin_cos();
    let away = place - centre;
    let along = away.x * cos + away.y * sin;
    let across = away.y * cos - away.x * sin;
    (along / ellipse.semi_major).hypot(across / ellipse.semi_minor) <= 1.0
}

/// Seed 85, 4000 runs for each number of bearings; the band leaves out 0.1 % of a binomial
/// distribution, and has 1 % of room for κ's approximation and the curvature at σ 0.02 rad.
#[test]
fn the_ellipse_of_few_bearings_holds_what_it_promises() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(85);
    let runs = 4000_u16;
    for count in [4_usize, 6, 10] {
        let mut held = 0_u16;
        let mut held_by_chi_squared = 0_u16;
        for _ in 0..runs {
            let place = Vector2::new(50.0 + 20.0 * rng.random::<f64>(), 40.0 * rng.random::<f64>());
            let all = simulate(&mut rng, place, 0.02);
            let lines: Vec<_> = (0..count).map(|i| all[i * 10 / count]).collect();
            let fix = Lenth1981::maximum_likelihood().locate(&lines).expect("a fix");
            let ellipse = fix.ellipse(0.95).expect("degrees of freedom are left");
            held += u16::from(holds(&ellipse, &fix.position.mean, &place));
            let plain = fix.position.ellipse(0.95).expect("definite");
            held_by_chi_squared += u16::from(holds(&plain, &fix.position.mean, &place));
        }
        let share = f64::from(held) / f64::from(runs);
        let band = 0.01 + 3.3 * (0.95_f64 * 0.05 / f64::from(runs)).sqrt();
        println!("{count} bearings: {share}, by χ² {}", f64::from(held_by_chi_squared) / 4000.0);
        assert!(abs_diff_eq!(share, 0.95, epsilon = band), "{count} bearings: {share}");
        assert!(count > 6 || f64::from(held_by_chi_squared) < 0.9 * f64::from(runs));
    }
}

#[test]
fn bearings_that_meet_in_a_point_have_the_largest_kappa() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(83);
    let place = Vector2::new(70.0, 30.0);
    let fix = Lenth1981::maximum_likelihood().locate(&simulate(&mut rng, place, 0.0));
    let fix = fix.expect("a fix");
    assert!((fix.position.mean - place).norm() < 1e-6);
    assert_abs_diff_eq!(fix.kappa / 1e12, 1.0, epsilon = 1e-9);
}

fn line(east: f64, north: f64, bearing: f64) -> BearingLine {
    BearingLine { receiver: Vector2::new(east, north), bearing }
}

#[test]
fn bearings_without_a_place_are_refused() {
    let locate = |lines: &[BearingLine]| Lenth1981::maximum_likelihood().locate(lines);
    let two = [line(0.0, 0.0, 0.7), line(10.0, 0.0, 2.0)];
    let too_few = BatchError::TooFew { what: "bearings", have: 2, need: 3 };
    assert_eq!(locate(&two), Err(too_few));
    let parallel = [0.0, 10.0, 20.0].map(|east| line(east, 0.0, 1.0));
    assert!(matches!(locate(&parallel), Err(BatchError::Flat { .. })));
    let one_place = [0.5, 1.0, 1.5].map(|bearing| line(3.0, 4.0, bearing));
    assert!(locate(&one_place).is_err(), "one place gives no range");
    // Rays that spread: their lines meet behind the receivers.
    let spreading = [line(0.0, 0.0, 2.0), line(10.0, 0.0, 1.6), line(20.0, 0.0, 1.1)];
    assert!(locate(&spreading).is_err(), "{:?}", locate(&spreading));
    let nan = [two[0], two[1], line(1.0, f64::NAN, 1.0)];
    assert!(matches!(locate(&nan), Err(BatchError::Value { index: 2, .. })));
    let near_parallel = [line(0.0, 0.0, 1.0), line(10.0, 0.0, 1.0 + 1e-7), line(20.0, 0.0, 1.0)];
    assert!(locate(&near_parallel).is_err(), "{:?}", locate(&near_parallel));
    for c in [0.0, -1.0, f64::NAN] {
        let even = Lenth1981::maximum_likelihood();
        assert!(even.with_weights(BearingWeights::Huber { c }).is_err());
        assert!(even.with_weights(BearingWeights::Andrews { c }).is_err());
        assert!(even.with_kappa(c).is_err());
    }
    let short = Lenth1981::maximum_likelihood().with_most_iterations(1);
    let three = [two[0], two[1], line(5.0, -3.0, 1.3)];
    assert_eq!(short.locate(&three), Err(BatchError::NotConverged { iterations: 1 }));
    assert!(matches!(repeated_median(&parallel[..]), Err(BatchError::TooFew { need: 4, .. })));
    let parallel = [0.0, 10.0, 20.0, 40.0].map(|east| line(east, 0.0, 1.0));
    assert!(matches!(repeated_median(&parallel), Err(BatchError::Flat { .. })));
}

/// Bearings from 30 receivers along a leg of 300 m, from which the target lies 250 m off.
fn along_a_leg(rng: &mut Xoshiro256PlusPlus, sigma: f64) -> Vec<(BearingLine, f64)> {
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
    for (line, sigma) in along_a_leg(&mut Xoshiro256PlusPlus::seed_from_u64(0), 0.0) {
        let way = PLACE - line.receiver;
        let slope = Vector2::new(-way.y, way.x) / way.norm_squared() / sigma;
        information += slope * slope.transpose();
    }
    information.cholesky().expect("definite").inverse().trace()
}

/// The mean error's norm, its standard error, and the mean squared error over the bound.
fn statistics(estimator: ClosedForm, seed: u64) -> (f64, f64, f64) {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let runs = 4000_u16;
    let mut sum = Vector2::zeros();
    let mut square = 0.0;
    for _ in 0..runs {
        let error = estimator(&along_a_leg(&mut rng, SIGMA)).expect("a fix").mean - PLACE;
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
    let exact = along_a_leg(&mut Xoshiro256PlusPlus::seed_from_u64(92), 0.0);
    let estimators: [ClosedForm; 3] = [pseudolinear, stansfield, instrumental_variables];
    for estimator in estimators {
        let fix = estimator(&exact).expect("a fix");
        assert!((fix.mean - PLACE).norm() < 1e-9);
        assert_abs_diff_eq!(fix.covariance.trace() / bound(), 1.0, epsilon = 1e-9);
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
