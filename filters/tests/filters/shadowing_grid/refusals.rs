//! Refused inputs, and the words of the refusals.

use foxhunt_core::Pose;
use foxhunt_filters::{
    Intercept, ShadowingGrid, ShadowingGridConfig, ShadowingGridError as Error, Slope,
};
use nalgebra::Vector2;

use super::world::{lawn_mower, level, simple};

fn flight() -> Vec<(Pose, f64)> {
    let place = Vector2::new(40.0, 20.0);
    lawn_mower(2, 10, 10.0, 40.0).into_iter().map(|r| (r, 3.0 * level(&place, &r)[0])).collect()
}

fn refusal(readings: &[(Pose, f64)], config: ShadowingGridConfig) -> Error {
    let estimator = ShadowingGrid::new(config).expect("in range");
    estimator.locate(readings, level).expect_err("not to be located")
}

#[test]
fn a_reading_that_is_not_finite_is_named() {
    for value in [f64::NAN, f64::INFINITY] {
        let mut readings = flight();
        readings[7].1 = value;
        readings[9].1 = f64::NAN;
        let error = refusal(&readings, simple());
        assert!(matches!(error, Error::Value { index: 7, .. }), "{error}");
        assert!(error.to_string().contains(&value.to_string()));
    }
    let mut readings = flight();
    readings[4].0.position.z = f64::NAN;
    assert_eq!(refusal(&readings, simple()), Error::Receiver { index: 4 });
}

#[test]
fn too_short_a_flight_is_refused() {
    let few = |segments| Error::TooFew { segments };
    let cut = || ShadowingGridConfig { segment_m: 10.0, ..simple() };
    assert_eq!(refusal(&[], cut()), few(0));
    // 29 m are three segments of 10 m, 19 m are two.
    let path = |metres: u8| -> Vec<_> {
        (0..=metres).map(|i| (Pose::at(f64::from(i), 0.0, 20.0), f64::from(i % 7))).collect()
    };
    assert_eq!(refusal(&path(19), cut()), few(2));
    let estimator = ShadowingGrid::new(cut()).expect("in range");
    assert!(estimator.locate(path(29), level).is_ok());
}

#[test]
fn one_place_locates_nothing() {
    let readings: Vec<_> =
        (0..9_u8).map(|i| (Pose::at(3.0, -2.0, 10.0 + f64::from(i)), f64::from(i))).collect();
    for segment_m in [0.0, 10.0] {
        let config = ShadowingGridConfig { segment_m, ..simple() };
        assert_eq!(refusal(&readings, config), Error::OnePlace { east: 3.0, north: -2.0 });
    }
}

#[test]
fn coinciding_places_without_a_nugget_are_refused() {
    let mut readings = flight();
    readings[5].0 = readings[4].0;
    let config = ShadowingGridConfig { nuggets: vec![0.2, 0.0], ..simple() };
    assert_eq!(refusal(&readings, config), Error::Correlation { length_m: 15.0 });
}

#[test]
fn a_regressor_that_is_finite_nowhere_is_refused() {
    let error = ShadowingGrid::default().locate(flight(), |_, _| [f64::NAN; 2]);
    assert!(matches!(error, Err(Error::Posterior { cells }) if cells > 1000), "{error:?}");
    // Receivers a universe apart: no cell size makes sense, and nothing hangs.
    let mut readings = flight();
    readings[0].0.position.x = 1e300;
    let far = refusal(&readings, simple());
    assert!(matches!(far, Error::Posterior { .. }), "{far}");
}

#[test]
fn settings_outside_of_their_range_are_named() {
    let with = |change: fn(&mut ShadowingGridConfig)| {
        let mut config = ShadowingGridConfig::default();
        change(&mut config);
        match ShadowingGrid::new(config).expect_err("out of range") {
            Error::Parameter(error) => error.name,
            other => panic!("{other}"),
        }
    };
    assert_eq!(with(|c| c.intercept = Intercept::Known(f64::NAN)), "the intercept");
    let calibrated = |variance| Intercept::Calibrated { regressor: -20.0, value: -80.0, variance };
    let mut config = ShadowingGridConfig { intercept: calibrated(1.0), ..<_>::default() };
    assert!(ShadowingGrid::new(config.clone()).is_ok());
    config.intercept = calibrated(0.0);
    let error = ShadowingGrid::new(config).expect_err("out of range").to_string();
    assert!(error.contains("the calibration's variance is 0"), "{error}");
    assert_eq!(with(|c| c.slope = Slope::Known(f64::INFINITY)), "the slope");
    assert_eq!(with(|c| c.slope = Slope::Nodes(vec![])), "the number of slopes");
    assert_eq!(with(|c| c.slope = Slope::Nodes(vec![(f64::NAN, 1.0)])), "the slope");
    assert_eq!(with(|c| c.slope = Slope::Nodes(vec![(2.0, 0.0)])), "the slope's weight");
    assert_eq!(with(|c| c.correlation_lengths_m.clear()), "the number of correlation lengths");
    assert_eq!(with(|c| c.correlation_lengths_m[1] = 0.0), "correlation_length_m");
    assert_eq!(with(|c| c.gain = Slope::Nodes(vec![(0.0, -1.0)])), "the gain's weight");
    assert_eq!(with(|c| c.nuggets.clear()), "the number of nuggets");
    assert_eq!(with(|c| c.nuggets[1] = 1.1), "nugget");
    assert_eq!(with(|c| c.nuggets[0] = f64::NAN), "nugget");
    assert_eq!(with(|c| c.quantile = 1.01), "quantile");
    assert_eq!(with(|c| c.margin_m = -1.0), "margin_m");
    assert_eq!(with(|c| c.cell_m = 0.0), "cell_m");
    assert_eq!(with(|c| c.max_cells = 99), "max_cells");
    assert_eq!(with(|c| c.segment_m = -0.1), "segment_m");
    assert_eq!(with(|c| c.max_segments = 3), "max_segments");
}

#[test]
fn a_gaussian_slope_has_limits_and_steps_or_is_refused() {
    let slope = Slope::gaussian(2.0, 0.5, 1.0, 3.0, 0.5).expect("proper");
    let proper = Slope::Gaussian { mean: 2.0, sd: 0.5, lower: 1.0, upper: 3.0, step: 0.5 };
    assert_eq!(slope, proper);
    for (mean, sd, lower, upper, step) in [
        (f64::NAN, 0.5, 1.0, 3.0, 0.5),
        (2.0, 0.0, 1.0, 3.0, 0.5),
        (2.0, 0.5, f64::NAN, 3.0, 0.5),
        (2.0, 0.5, 1.0, 0.9, 0.5),
        (2.0, 0.5, 1.0, f64::INFINITY, 0.5),
        (2.0, 0.5, 1.0, 3.0, 0.0),
        (2.0, 0.5, 1.0, 3.0, 1e-6),
    ] {
        let slope = Slope::gaussian(mean, sd, lower, upper, step);
        assert!(matches!(slope, Err(Error::Parameter(_))), "{slope:?}");
    }
}
