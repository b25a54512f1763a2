//! Path-loss calibration: closed form, recovery, real readings.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use foxhunt_sensors::{CalibrationError, LogDistance, Propagation, fit_log_distance};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{Distribution, Normal};

use crate::vectors::shared;

/// Three points solved by hand: x = −10 log₁₀ d is 0, −10, −20, y is −30, −51, −69; slope 1.95,
/// residuals 0.5, −1 and 0.5 dB, so SSE = 1.5 dB² on one degree of freedom.
#[test]
fn the_closed_form() {
    let fit = fit_log_distance([(1.0, -30.0), (10.0, -51.0), (100.0, -69.0)], None);
    let fit = fit.expect("a fit");
    for (ours, exact) in [
        (fit.exponent, 1.95),
        (fit.reference_dbm, -30.5),
        (fit.rmse_db, 0.5_f64.sqrt()),
        (fit.sigma_db, 1.5_f64.sqrt()),
        (fit.exponent_error(), (1.5_f64 / 200.0).sqrt()),
        (fit.reference_error_db(), (1.5 * (1.0 / 3.0 + 100.0 / 200.0_f64)).sqrt()),
        (fit.covariance[(0, 1)], 1.5 * 10.0 / 200.0),
        (fit.covariance[(1, 0)], 1.5 * 10.0 / 200.0),
    ] {
        assert_abs_diff_eq!(ours, exact, epsilon = 1e-12);
    }
    assert!(!fit.at_bound && fit.points == 3);
}

/// At the bound γ = 1.5: the mean stays, the residuals are −5 + 0.5, −1 and 5 + 0.5 … by hand.
#[test]
fn a_bound_holds_the_exponent_and_conditions_the_power() {
    let points = [(1.0, -30.0), (10.0, -51.0), (100.0, -69.0)];
    let fit = fit_log_distance(points, Some(1.5)).expect("a fit");
    assert!(fit.at_bound && abs_diff_eq!(fit.exponent, 1.5, epsilon = 1e-15));
    // P₀ = −50 + 1.5 · 10; residuals 5, −1, −4 dB.
    assert_abs_diff_eq!(fit.reference_dbm, -35.0, epsilon = 1e-12);
    assert_abs_diff_eq!(fit.rmse_db, (42.0_f64 / 3.0).sqrt(), epsilon = 1e-12);
    assert_abs_diff_eq!(fit.sigma_db, 21.0_f64.sqrt(), epsilon = 1e-12);
    assert_abs_diff_eq!(fit.reference_error_db(), 7.0_f64.sqrt(), epsilon = 1e-12);
    assert_abs_diff_eq!(fit.exponent_error(), 0.0, epsilon = 1e-15);
    // A bound that does not bind changes nothing.
    assert_eq!(fit_log_distance(points, Some(3.0)), fit_log_distance(points, None));
}

/// 1000 calibrations of 40 points, seed 11. χ² = e' P⁻¹ e / 2 follows F(2, 38), whose mean is
/// 38/36 and whose variance is 2·38²·38/(2·36²·34) = 1.245; the mean of 1000 lies within 4 standard
/// errors, 4·√(1.245/1000) = 0.141, but for 6e-5 of seeds.
#[test]
fn standard_errors_are_honest() {
    let truth = LogDistance::pritzl2018_field();
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(11);
    let noise = Normal::new(0.0, 4.0).expect("a standard deviation");
    let mut statistic = 0.0;
    for _ in 0..1000 {
        let points: Vec<(f64, f64)> = (0..40)
            .map(|_| {
                let range: f64 = rng.random_range(3.0..80.0);
                (range, truth.rss_dbm(range) + noise.sample(&mut rng))
            })
            .collect();
        let fit = fit_log_distance(points, None).expect("a fit");
        let error = nalgebra::Vector2::new(
            fit.reference_dbm - truth.reference_dbm(),
            fit.exponent - truth.exponent(),
        );
        let factor = fit.covariance.cholesky().expect("positive definite");
        statistic += error.dot(&factor.solve(&error)) / 2.0;
    }
    let mean = statistic / 1000.0;
    assert_abs_diff_eq!(mean, 38.0 / 36.0, epsilon = 0.141);
}

/// The covariance of the closed form is inverted by Cramer's rule; the rim of the ellipse is where
/// eᵀ C⁻¹ e is twice the F quantile of 2 and 1 degrees of freedom, 199.5 at 95 % (Abramowitz &
/// Stegun 1964, table 26.9).
#[test]
fn the_rim_of_the_region_is_the_quantile_of_f() {
    let fit = fit_log_distance([(1.0, -30.0), (10.0, -51.0), (100.0, -69.0)], None).expect("a fit");
    let region = fit.region(0.95).expect("it is uncertain");
    let (a, b, c) = (fit.covariance[(0, 0)], fit.covariance[(0, 1)], fit.covariance[(1, 1)]);
    let weigh = |x: f64, y: f64| (c * x * x - 2.0 * b * x * y + a * y * y) / (a * c - b * b);
    let (sin, cos) = region.orientation.sin_cos();
    for (x, y) in [
        (region.semi_major * cos, region.semi_major * sin),
        (-region.semi_minor * sin, region.semi_minor * cos),
    ] {
        assert!(abs_diff_eq!(weigh(x, y) / (2.0 * 199.5), 1.0, epsilon = 1e-4), "{}", weigh(x, y));
    }
    // Student's t with one degree of freedom at 95 % is 12.706.
    let [low, high] = fit.exponent_interval(0.95).expect("it is free");
    assert!(abs_diff_eq!(high - 1.95, 12.706 * fit.exponent_error(), epsilon = 1e-3) && low < 1.95);
    assert_abs_diff_eq!(fit.correlation(), b / (a * c).sqrt(), epsilon = 1e-12);
    let held = fit_log_distance([(1.0, -30.0), (10.0, -51.0), (100.0, -69.0)], Some(1.5));
    let held = held.expect("a fit");
    assert!(held.region(0.95).is_none() && held.exponent_interval(0.95).is_none());
    // Two degrees of freedom: 4.3027.
    let [low, high] = held.reference_interval(0.95).expect("it is free");
    assert_abs_diff_eq!(0.5 * (high - low), 4.3027 * held.reference_error_db(), epsilon = 1e-3);
    assert!(fit.region(1.0).is_none() && fit.reference_interval(0.0).is_none());
}

/// Few points, so that an ellipse with χ² in place of F would hold 91.5 % only. 4000 calibrations
/// of 15 points, seed 12: the share of truths inside is binomial, 0.95 ± 4·√(0.95·0.05/4000) =
/// 0.0138 but for 6e-5 of seeds. Each of the two intervals alone holds as many.
#[test]
fn the_joint_region_has_its_level() {
    let truth = LogDistance::pritzl2018_field();
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(12);
    let noise = Normal::new(0.0, 4.0).expect("a standard deviation");
    let (mut joint, mut power, mut exponent) = (0_u32, 0_u32, 0_u32);
    for _ in 0..4000 {
        let points: Vec<(f64, f64)> = (0..15)
            .map(|_| {
                let range: f64 = rng.random_range(5.0..60.0);
                (range, truth.rss_dbm(range) + noise.sample(&mut rng))
            })
            .collect();
        let fit = fit_log_distance(points, None).expect("a fit");
        let ellipse = fit.region(0.95).expect("it is uncertain");
        let (x, y) = (truth.reference_dbm() - fit.reference_dbm, truth.exponent() - fit.exponent);
        let (sin, cos) = ellipse.orientation.sin_cos();
        let along = (cos * x + sin * y) / ellipse.semi_major;
        let across = (cos * y - sin * x) / ellipse.semi_minor;
        joint += u32::from(along * along + across * across <= 1.0);
        let within = |interval: Option<[f64; 2]>, value: f64| {
            interval.is_some_and(|[low, high]| (low..=high).contains(&value))
        };
        power += u32::from(within(fit.reference_interval(0.95), truth.reference_dbm()));
        exponent += u32::from(within(fit.exponent_interval(0.95), truth.exponent()));
    }
    for held in [joint, power, exponent] {
        let share = f64::from(held) / 4000.0;
        assert_abs_diff_eq!(share, 0.95, epsilon = 0.0138);
    }
}

/// 847 readings of VHF tags: published exponent 2.29 and standard deviation 4.1 dB, to their
/// digits.
#[test]
fn real_readings_have_the_published_exponent() {
    let Some(text) = shared("data/rssi_distance/vhf_tags.csv") else { return };
    let points: Vec<(f64, f64)> = text
        .lines()
        .skip(1)
        .map(|line| {
            let fields: Vec<f64> = line.split(',').filter_map(|f| f.parse().ok()).collect();
            (fields[2], fields[1])
        })
        .collect();
    assert_eq!(points.len(), 847);
    let fit = fit_log_distance(points, None).expect("a fit");
    assert_abs_diff_eq!(fit.exponent, 2.29, epsilon = 0.005);
    assert_abs_diff_eq!(fit.sigma_db, 4.1, epsilon = 0.05);
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let fit = |points: &[(f64, f64)]| fit_log_distance(points.iter().copied(), None);
    let two = [(1.0, -30.0), (2.0, -36.0)];
    assert_eq!(fit(&two), Err(CalibrationError::TooFew { points: 2, needed: 3 }));
    assert_eq!(
        fit(&[(1.0, -30.0), (0.0, -30.0)]),
        Err(CalibrationError::Range { index: 1, range: 0.0 })
    );
    assert_eq!(
        fit(&[(1.0, f64::INFINITY)]),
        Err(CalibrationError::Rss { index: 0, rss_dbm: f64::INFINITY })
    );
    assert!(matches!(
        fit(&[(1.0, -1.0), (2.0, f64::NAN)]),
        Err(CalibrationError::Rss { index: 1, rss_dbm }) if rss_dbm.is_nan()
    ));
    assert!(matches!(
        fit(&[(7.3, -40.0), (7.3, -41.0), (7.3, -39.0)]),
        Err(CalibrationError::OneRange { range }) if abs_diff_eq!(range, 7.3, epsilon = 1e-9)
    ));
    assert_eq!(fit_log_distance(two, Some(0.0)), Err(CalibrationError::Bound { bound: 0.0 }));
    // Power that rises with range is fitted, but is no law.
    let rising = fit(&[(1.0, -60.0), (10.0, -50.0), (100.0, -40.0)]).expect("a fit");
    assert!(abs_diff_eq!(rising.exponent, -1.0, epsilon = 1e-12) && rising.law().is_err());
}
