//! Inputs that may change the answer, and inputs that must not.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use core::f64::consts::FRAC_PI_6;

use foxhunt_core::{Belief, Pose};
use foxhunt_filters::{
    Censoring, Intercept, PlacePrior, ShadowedReading, ShadowingFix, ShadowingGrid,
    ShadowingGridConfig, ShadowingGridError, Slope,
};
use nalgebra::{Matrix2, Rotation2, Vector2};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

use super::world::{Truth, lawn_mower, level, readings, simple};

const TRUTH: Truth = Truth {
    place: Vector2::new(130.0, 50.0),
    intercept: -40.0,
    slope: 2.5,
    gain: 0.0,
    sigma: 2.0,
    length_m: 25.0,
    nugget: 0.2,
};

fn flight(seed: u64, truth: &Truth) -> Vec<(Pose, f64)> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    readings(&lawn_mower(3, 9, 25.0, 60.0), truth, &mut rng)
}

fn locate(readings: &[(Pose, f64)], config: ShadowingGridConfig) -> ShadowingFix {
    let estimator = ShadowingGrid::new(config).expect("in range");
    estimator.locate(readings, level).expect("a posterior")
}

fn keeping_all() -> ShadowingGridConfig {
    ShadowingGridConfig { margin_m: 100.0, ..simple() }
}

#[test]
fn a_constant_is_the_intercepts() {
    let readings = flight(1, &TRUTH);
    let louder: Vec<_> = readings.iter().map(|(r, value)| (*r, value + 1e4)).collect();
    let fix = locate(&readings, keeping_all());
    let shifted = locate(&louder, keeping_all());
    // 1e4 costs four digits of the values, and no more.
    for (a, b) in fix.map.mass().iter().zip(shifted.map.mass()) {
        assert_abs_diff_eq!(a, b, epsilon = 1e-10);
    }
    assert!((fix.position.mean - shifted.position.mean).norm() < 1e-7);
    assert_abs_diff_eq!(fix.intercept.mean + 1e4, shifted.intercept.mean, epsilon = 1e-7);
    assert_abs_diff_eq!(fix.intercept.sd, shifted.intercept.sd, epsilon = 1e-7);
    // With the intercept known it is not free to move.
    let known = ShadowingGridConfig { intercept: Intercept::Known(-40.0), ..keeping_all() };
    let moved = locate(&louder, known.clone()).position.mean;
    assert!((locate(&readings, known).position.mean - moved).norm() > 20.0);
}

#[test]
fn the_unit_of_the_values_does_not_matter() {
    let readings = flight(9, &TRUTH);
    let fix = locate(&readings, keeping_all());
    let Slope::Gaussian { mean, sd, lower, upper, step } = keeping_all().slope else {
        panic!("the default is Gaussian")
    };
    // Far enough for every likelihood to overflow or underflow without its logarithm.
    for unit in [1e-30, 1e30] {
        let scaled: Vec<_> = readings.iter().map(|(r, value)| (*r, value * unit)).collect();
        let [mean, sd, lower, upper, step] = [mean, sd, lower, upper, step].map(|b| b * unit);
        let slope = Slope::Gaussian { mean, sd, lower, upper, step };
        let other = locate(&scaled, ShadowingGridConfig { slope, ..keeping_all() });
        assert!((fix.position.mean - other.position.mean).norm() < 1e-7);
        assert_abs_diff_eq!(fix.sigma.mean, other.sigma.mean / unit, epsilon = 1e-7);
        assert_abs_diff_eq!(fix.intercept.sd, other.intercept.sd / unit, epsilon = 1e-7);
    }
}

#[test]
fn the_estimate_moves_with_the_world() {
    let readings = flight(2, &TRUTH);
    let fix = locate(&readings, keeping_all());
    let shift = Vector2::new(5000.0, -700.0);
    let moved_by = |rotation: Rotation2<f64>| {
        let moved = |pose: &Pose| {
            let place = rotation * pose.position.xy() + shift;
            Pose::at(place.x, place.y, pose.position.z)
        };
        let moved: Vec<_> = readings.iter().map(|(r, value)| (moved(r), *value)).collect();
        let moved = locate(&moved, keeping_all());
        let mean = rotation.inverse() * (moved.position.mean - shift);
        let covariance = rotation.inverse() * moved.position.covariance * rotation;
        ((mean - fix.position.mean).norm(), (covariance - fix.position.covariance).norm())
    };
    // After a quarter turn the cells are the same ones, but for rounding.
    let quarter = Rotation2::from_matrix_unchecked(Matrix2::new(0.0, -1.0, 1.0, 0.0));
    let (mean, covariance) = moved_by(quarter);
    assert!(mean < 1e-6 && covariance < 1e-5, "{mean} {covariance}");
    // In between they are others, and their rectangle cuts the prior elsewhere.
    let (mean, covariance) = moved_by(Rotation2::new(FRAC_PI_6));
    let size = fix.position.covariance.norm();
    assert!(mean < 0.02 * size.sqrt() && covariance < 0.02 * size, "{mean} {covariance} of {size}");
}

#[test]
fn who_knows_more_is_surer() {
    let known = |intercept, slope| ShadowingGridConfig { intercept, slope, ..keeping_all() };
    let prior = keeping_all().slope;
    let configs = [
        keeping_all(),
        known(Intercept::Flat, Slope::Known(2.5)),
        known(Intercept::Known(-40.0), prior),
        known(Intercept::Known(-40.0), Slope::Known(2.5)),
    ];
    let truth = Truth { sigma: 5.0, ..TRUTH };
    let areas = configs.map(|config| -> f64 {
        let area = |seed| locate(&flight(seed, &truth), config.clone()).position.covariance;
        (0..12).map(|seed| area(seed).determinant().sqrt()).sum::<f64>() / 12.0
    });
    println!("mean √|P|: {areas:.0?}");
    assert!(areas[0] > areas[1] && areas[0] > areas[2], "{areas:?}");
    assert!(areas[1] > areas[3] && areas[2] > areas[3], "{areas:?}");
}

#[test]
fn a_narrow_posterior_is_resolved_on_finer_cells() {
    for (seed, sigma) in [(3, 0.5), (4, 0.02)] {
        let readings = flight(seed, &Truth { sigma, ..TRUTH });
        let near = ShadowingGridConfig { margin_m: 20.0, ..keeping_all() };
        let coarse = ShadowingGridConfig { cell_m: 20.0, ..near.clone() };
        let fix = locate(&readings, coarse);
        let map = fix.refined.as_ref().expect("the posterior is narrower than 20 m");
        // The same from a grid that was fine from the start, over the middle of the refined one.
        let sd = fix.position.covariance.determinant().powf(0.25);
        assert!(3.0 * map.cell_m() < 2.0 * sd && sd < 20.0, "cells of {} for {sd}", map.cell_m());
        assert!(map.border_mass() < 1e-6, "{}", map.border_mass());
        let nees = fix.position.nees(&TRUTH.place).expect("positive definite");
        assert!(nees < 20.0, "the refined grid missed the mass: {nees}");
        // σ = 0.02 would need 20 million cells to see from afar.
        if seed == 3 {
            let fine = ShadowingGridConfig { cell_m: 0.8, max_cells: 1_000_000, ..near };
            let fine = locate(&readings, fine);
            assert!((fine.position.mean - fix.position.mean).norm() < 0.01 * sd);
            let apart = (fine.position.covariance - fix.position.covariance).norm();
            assert!(apart < 0.02 * sd * sd, "{apart} of {}", sd * sd);
        }
    }
}

#[test]
fn gross_errors_on_both_sides_do_not_move_the_place() {
    let config = ShadowingGridConfig { gain: Slope::Known(0.0), ..ShadowingGridConfig::default() };
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(21);
    let mut moved_m = Vec::new();
    for _ in 0..8 {
        let path = lawn_mower(6, 40, 6.0, 45.0);
        let truth = Truth { place: Vector2::new(130.0, 110.0), ..TRUTH };
        let clean = readings(&path, &truth, &mut rng);
        let mut wrong = clean.clone();
        let planted: Vec<usize> = (3..wrong.len()).step_by(9).collect();
        for (number, index) in planted.iter().enumerate() {
            wrong[*index].1 += if number.is_multiple_of(2) { 25.0 } else { -25.0 };
        }
        let without = locate(&clean, config.clone());
        assert_eq!(without.left_out, [0_usize; 0]);
        let fix = locate(&wrong, config.clone());
        assert_eq!(fix.left_out, planted);
        moved_m.push((fix.position.mean - without.position.mean).norm());
    }
    assert!(moved_m.iter().all(|moved| *moved < 6.0), "{moved_m:?}");
}

#[test]
fn a_target_outside_of_the_searched_area_shows_on_its_border() {
    let inside = locate(&flight(5, &TRUTH), keeping_all());
    assert!(inside.border_mass < 0.01, "{}", inside.border_mass);
    let outside = Truth { place: Vector2::new(500.0, 50.0), sigma: 1.0, ..TRUTH };
    let outside = locate(&flight(5, &outside), keeping_all());
    assert!(outside.border_mass > 0.2, "{}", outside.border_mass);
}

#[test]
fn near_the_receivers_the_margin_does_not_matter() {
    let outside = Truth { place: Vector2::new(290.0, 50.0), sigma: 1.0, ..TRUTH };
    for truth in [TRUTH, Truth { sigma: 6.0, ..TRUTH }, outside] {
        let readings = flight(5, &truth);
        let fixes = [50.0, 200.0, 800.0].map(|margin_m| {
            let place = PlacePrior::NearReceivers { far_share: 0.0, reach: 1.0 };
            let fix = locate(&readings, ShadowingGridConfig { place, margin_m, ..simple() });
            (fix.finest().median(), fix.position.covariance.determinant().powf(0.25))
        });
        for (median, sd) in fixes {
            let apart = (median - fixes[0].0).norm();
            assert!(apart < 0.05 * fixes[0].1, "{apart} of {}", fixes[0].1);
            assert_abs_diff_eq!(sd / fixes[0].1, 1.0, epsilon = 0.05);
        }
    }
}

#[test]
fn the_caps_hold_and_are_reported() {
    let config =
        ShadowingGridConfig { max_cells: 500, segment_m: 10.0, max_segments: 15, ..simple() };
    let fix = locate(&flight(6, &TRUTH), config);
    assert!(fix.map.mass().len() <= 500 && fix.map.cell_m() > 10.0);
    assert!(fix.segments <= 15 && fix.segments > 10 && fix.stretch > 2.0, "{}", fix.stretch);
    assert_eq!(fix.map.mass().len(), fix.map.columns() * fix.map.rows());
}

#[test]
fn the_belief_is_the_map() {
    let fix = locate(&flight(7, &TRUTH), keeping_all());
    let mut total = 0.0;
    let mut mean = Vector2::zeros();
    fix.visit_positions(&mut |place, weight| {
        total += weight;
        mean += place * weight;
    });
    assert!(abs_diff_eq!(total, 1.0, epsilon = 1e-12) && (mean - fix.position.mean).norm() < 1e-9);
    assert_eq!(fix.position(), fix.position);
    let lengths: f64 = fix.correlation_lengths_m.iter().map(|length| length.1).sum();
    assert_abs_diff_eq!(lengths, 1.0, epsilon = 1e-12);
}

#[test]
fn a_place_where_the_regressor_is_not_finite_is_impossible() {
    let estimator = ShadowingGrid::new(keeping_all()).expect("in range");
    let north_only = |cell: &Vector2<f64>, receiver: &Pose| {
        if cell.y < 60.0 { [f64::NAN; 2] } else { level(cell, receiver) }
    };
    let fix = estimator.locate(flight(8, &TRUTH), north_only).expect("a posterior");
    assert!(fix.map.cells().all(|(place, mass)| if place.y < 60.0 {
        mass <= 0.0
    } else {
        mass.is_finite()
    }));
    assert_abs_diff_eq!(fix.map.mass().iter().sum::<f64>(), 1.0, epsilon = 1e-12);
    assert!(fix.position.mean.y > 60.0 && fix.position.nees(&TRUTH.place).is_some());
}

/// Levels of twelve stations over 2 km, of which one or two receive a target among them. All others
/// are at their floor, and tell where the target is not.
#[test]
fn one_level_among_silences_is_a_place() {
    const RUNS: u32 = 30;
    const FLOOR: f64 = -100.0;
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(11);
    let gain = Slope::Known(0.0);
    let of_network = ShadowingGridConfig::of_network(2000.0);
    let config = ShadowingGridConfig { gain, max_cells: 1000, ..of_network };
    let grid = ShadowingGrid::new(config).expect("in range");
    let [mut inside, mut single] = [0, 0];
    let [mut squares, mut of_middle] = [0.0, 0.0];
    for _ in 0..RUNS {
        let (readings, place) = loop {
            let mut side = || 2000.0 * rng.random::<f64>();
            let stations: Vec<Pose> = (0..12).map(|_| Pose::at(side(), side(), 10.0)).collect();
            let place = Vector2::new(side(), side());
            let intercept = -60.0 + 60.0 * rng.random::<f64>();
            let truth = Truth { place, intercept, slope: 3.0, sigma: 5.0, ..TRUTH };
            let readings = readings(&stations, &truth, &mut rng);
            let received = readings.iter().filter(|reading| reading.1 > FLOOR).count();
            if received == 1 || received == 2 {
                single += u32::from(received == 1);
                break (readings, place);
            }
        };
        let middle = readings.iter().map(|(pose, _)| pose.position.xy()).sum::<Vector2<f64>>();
        of_middle += (middle / 12.0 - place).norm_squared();
        let limited = readings.into_iter().map(|(receiver, value)| {
            let is_below = value <= FLOOR;
            let censoring = if is_below { Censoring::Below } else { Censoring::None };
            ShadowedReading { receiver, value: value.max(FLOOR), censoring }
        });
        let fix = grid.locate(limited, level).expect("a posterior");
        squares += (place - fix.position.mean).norm_squared();
        let nees = fix.position.nees(&place).expect("positive definite");
        inside += u32::from(nees < 5.991);
        assert!(fix.sigma.mean.is_finite() && fix.sigma.sd.is_finite(), "{:?}", fix.sigma);
    }
    let one = (Pose::at(0.0, 0.0, 10.0), -90.0);
    let few = |silences| {
        let silent = (0..silences).map(|i| Pose::at(900.0, 900.0 * f64::from(i), 10.0));
        let below =
            |receiver| ShadowedReading { receiver, value: FLOOR, censoring: Censoring::Below };
        let readings = core::iter::once(one.into()).chain(silent.map(below));
        grid.locate(readings.collect::<Vec<ShadowedReading>>(), level)
    };
    assert_eq!(few(1_u8), Err(ShadowingGridError::TooFew { segments: 2 }));
    assert!(few(2).is_ok());
    let share = (squares / of_middle).sqrt();
    println!("{inside} of {RUNS} ellipses hold, {single} of one level; {share:.2} of the middle");
    assert!((5..=25).contains(&single), "{single} of one level");
    // 95 % of 30 within 3.3 σ of chance.
    assert!(inside >= 25, "{inside} of {RUNS}");
    assert!(share < 0.6, "{share}");
}
