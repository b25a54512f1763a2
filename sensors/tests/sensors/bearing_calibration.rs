//! Offsets of bearings and scales of their σ: closed forms, recovery, coverage, refusals.

use approx::assert_abs_diff_eq;
use core::f64::consts::{PI, TAU};

use foxhunt_core::angle::{distance, wrap};
use foxhunt_sensors::{
    BearingError, BearingOffset, CalibrationError, KnownBearing, OffsetTerms, fit_bearing_offset,
    fit_sigma,
};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{Distribution, Normal, StudentT};

const STATED: BearingOffset = BearingOffset { constant: 3.0, sin_heading: 0.2, cos_heading: -0.1 };

/// Bearings that are off by `offset` at random headings, with these errors besides.
fn bearings(
    offset: BearingOffset,
    count: usize,
    rng: &mut Xoshiro256PlusPlus,
    error: impl Distribution<f64>,
) -> Vec<KnownBearing> {
    let one = |_| {
        let (truth, heading) = (rng.random_range(-PI..PI), rng.random_range(-PI..PI));
        let measured = wrap(truth + offset.at(heading) + 0.1 * error.sample(rng));
        KnownBearing { measured, truth, heading }
    };
    (0..count).map(one).collect()
}

fn normal() -> Normal<f64> {
    Normal::new(0.0, 1.0).expect("a standard deviation")
}

#[test]
fn exact_bearings_give_the_offset_back() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    let exact = Normal::new(0.0, 0.0).expect("no deviation");
    let known = bearings(STATED, 20, &mut rng, exact);
    let fit = fit_bearing_offset(known.iter().copied(), OffsetTerms::Heading).expect("a fit");
    assert!(distance(fit.offset.constant, STATED.constant) < 1e-9, "{fit:?}");
    assert_abs_diff_eq!(fit.offset.sin_heading, STATED.sin_heading, epsilon = 1e-9);
    assert_abs_diff_eq!(fit.offset.cos_heading, STATED.cos_heading, epsilon = 1e-9);
    for point in &known {
        assert!(distance(fit.offset.correct(point.measured, point.heading), point.truth) < 1e-9);
    }
    // Without the harmonic its 0.22 rad are left over, √((0.2² + 0.1²)/2) = 0.158 rms, give or take
    // what 20 random headings make of it.
    let constant = fit_bearing_offset(known, OffsetTerms::Constant).expect("a fit");
    assert!((0.1..0.22).contains(&constant.rms), "{constant:?}");
    assert_eq!((constant.offset.sin_heading, constant.covariance[(1, 1)]), (0.0, 0.0));
    assert_eq!(constant.harmonic_p_value(), None);
}

/// 2000 calibrations of 15 bearings each, Gaussian errors, seed 2, and 2000 with the tails of a
/// Student's t of two degrees of freedom. The standard errors are asymptotic: of 15 bearings with
/// three terms 95 % is held to ±2.5 %, of which 4·√(0.95·0.05/2000) = 1.95 % is chance.
#[test]
fn intervals_of_the_offset_have_their_level() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(2);
    for tails in [false, true] {
        for terms in [OffsetTerms::Constant, OffsetTerms::Heading] {
            let offset = match terms {
                OffsetTerms::Constant => {
                    BearingOffset { constant: STATED.constant, ..<_>::default() }
                }
                OffsetTerms::Heading => STATED,
            };
            let mut held = [0_u32; 3];
            for _ in 0..2000 {
                let known = if tails {
                    let law = StudentT::new(2.0).expect("degrees of freedom");
                    bearings(offset, 15, &mut rng, law)
                } else {
                    bearings(offset, 15, &mut rng, normal())
                };
                let Ok(fit) = fit_bearing_offset(known, terms) else { continue };
                let reach = fit.half_intervals(0.95).expect("proper");
                let error = [
                    distance(fit.offset.constant, offset.constant),
                    (fit.offset.sin_heading - offset.sin_heading).abs(),
                    (fit.offset.cos_heading - offset.cos_heading).abs(),
                ];
                for (held, (error, reach)) in held.iter_mut().zip(error.into_iter().zip(&reach)) {
                    *held += u32::from(error <= *reach);
                }
            }
            for held in held {
                let share = f64::from(held) / 2000.0;
                let exact = terms == OffsetTerms::Constant && share > 0.999;
                assert!(exact || (share - 0.95).abs() < 0.025, "{tails} {terms:?}: {share}");
            }
        }
    }
}

/// One bearing in five goes anywhere; 400 bearings, seed 3. The standard error of the mean of the
/// others would be 0.1/√320 = 0.0056 rad; four of those and as much for the outliers.
#[test]
fn outliers_do_not_turn_the_offset() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
    let offset = BearingOffset { constant: -0.3, ..<_>::default() };
    let mut known = bearings(offset, 400, &mut rng, normal());
    for point in known.iter_mut().step_by(5) {
        // To one side, as a reflection has it.
        point.measured = wrap(point.truth + rng.random_range(0.5..2.5));
    }
    let fit = fit_bearing_offset(known, OffsetTerms::Constant).expect("a fit");
    assert!(distance(fit.offset.constant, -0.3) < 0.045, "{fit:?}");
}

/// 2000 sets of 12 bearings without a harmonic, seed 4: p-values are uniform where nothing is
/// there, so that those under 5 % are 5 % ± 4·√(0.05·0.95/2000) = 1.95 %, and 1 % for the scores'
/// weights. With one of 0.22 rad against 0.1 rad of noise nearly all are found.
#[test]
fn the_test_for_a_harmonic_is_honest() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
    let mut share = |offset: BearingOffset| {
        let mut found = 0_u32;
        for _ in 0..2000 {
            let known = bearings(offset, 12, &mut rng, normal());
            let fit = fit_bearing_offset(known, OffsetTerms::Heading).expect("a fit");
            found += u32::from(fit.harmonic_p_value().expect("it was fitted") < 0.05);
        }
        f64::from(found) / 2000.0
    };
    let none = share(BearingOffset { constant: 1.0, ..<_>::default() });
    assert_abs_diff_eq!(none, 0.05, epsilon = 0.0295);
    let there = share(STATED);
    assert!(there > 0.95, "{there}");
}

/// σ between 0.05 and 0.25 rad, errors of (1.7 σ)² + 0.1²; 4000 bearings, seed 5, and then 300 sets
/// of 100 for the intervals: 95 % ± 4·√(0.95·0.05/300) = 5.0 %.
#[test]
fn scale_and_floor_of_sigma_come_back_within_their_intervals() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
    let mut draw = |count: usize| -> Vec<BearingError> {
        let one = |_| {
            let sigma: f64 = rng.random_range(0.05..0.25);
            let deviation = (1.7 * sigma).hypot(0.1);
            BearingError { error: deviation * normal().sample(&mut rng), sigma }
        };
        (0..count).map(one).collect()
    };
    let fit = fit_sigma(draw(4000)).expect("a fit");
    assert_abs_diff_eq!(fit.scale, 1.7, epsilon = 0.1);
    assert_abs_diff_eq!(fit.floor, 0.1, epsilon = 0.025);
    // 95 % ± 4·√(0.95·0.05/4000).
    assert_abs_diff_eq!(fit.fitted_coverage_95, 0.95, epsilon = 0.0138);
    assert!(fit.coverage_95 < 0.75 && fit.rms_ratio > 1.7, "{fit:?}");
    assert!(fit.correlation.is_some_and(|r| r > 0.2), "{fit:?}");
    assert!(fit.correlation_p_value.is_some_and(|p| p < 1e-6), "{fit:?}");
    let (mut scale, mut floor) = (0_u32, 0_u32);
    for _ in 0..300 {
        let fit = fit_sigma(draw(100)).expect("a fit");
        let within = |[low, high]: [f64; 2], value: f64| u32::from((low..=high).contains(&value));
        scale += within(fit.scale_interval, 1.7);
        floor += within(fit.floor_interval, 0.1);
    }
    for held in [scale, floor] {
        let share = f64::from(held) / 300.0;
        assert_abs_diff_eq!(share, 0.95, epsilon = 0.05);
    }
}

/// Five σ and |errors| by hand.
#[test]
fn the_correlation_is_tested_as_in_the_reference() {
    let stated = [(1.0, 1.0), (2.0, -3.0), (3.0, 2.0), (4.0, -4.0), (5.0, 5.0)];
    let fit = fit_sigma(stated.map(|(sigma, error)| BearingError { error, sigma })).expect("a fit");
    // |error| is 1, 3, 2, 4, 5: their products sum to 9 of 10.
    assert_abs_diff_eq!(fit.correlation.expect("they vary"), 0.9, epsilon = 1e-12);
    // t = 0.9·√(3/0.19) = 3.576; P = 0.0374.
    assert_abs_diff_eq!(fit.correlation_p_value.expect("it has one"), 0.0374, epsilon = 2e-4);
    // The same σ for all has no correlation, and a scale of the errors' rms over it.
    let same =
        fit_sigma(stated.map(|(_, error)| BearingError { error, sigma: 2.0 })).expect("a fit");
    assert_eq!((same.correlation, same.correlation_p_value, same.floor), (None, None, 0.0));
    assert_abs_diff_eq!(same.scale, (55.0_f64 / 5.0).sqrt() / 2.0, epsilon = 1e-6);
    assert_abs_diff_eq!(same.scale, same.rms_ratio, epsilon = 1e-6);
}

#[test]
fn what_cannot_be_calibrated_is_refused() {
    let point = |measured: f64, heading: f64| KnownBearing { measured, truth: 0.0, heading };
    let fit = |points: &[KnownBearing], terms| fit_bearing_offset(points.iter().copied(), terms);
    assert_eq!(
        fit(&[point(0.1, 0.0); 2], OffsetTerms::Constant),
        Err(CalibrationError::TooFew { points: 2, needed: 3 })
    );
    assert!(matches!(
        fit(&[point(0.1, 0.0), point(0.1, f64::NAN)], OffsetTerms::Constant),
        Err(CalibrationError::Field { index: 1, field: "heading", .. })
    ));
    assert_eq!(fit(&[point(0.1, 1.0); 9], OffsetTerms::Heading), Err(CalibrationError::Headings));
    let around: Vec<_> = (0..9).map(|i| point(TAU * f64::from(i) / 9.0, 0.0)).collect();
    assert!(matches!(
        fit(&around, OffsetTerms::Constant),
        Err(CalibrationError::Scattered { resultant }) if resultant < 1e-9
    ));
    let error = |error: f64, sigma: f64| BearingError { error, sigma };
    assert!(matches!(
        fit_sigma([error(0.1, 0.1), error(0.1, 0.0)]),
        Err(CalibrationError::Field { index: 1, field: "σ", .. })
    ));
    assert_eq!(
        fit_sigma([error(0.1, 0.1); 4]),
        Err(CalibrationError::TooFew { points: 4, needed: 5 })
    );
    assert_eq!(fit_sigma([error(0.0, 0.1); 9]), Err(CalibrationError::NoError));
}
