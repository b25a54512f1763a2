use alloc::vec::Vec;

use nalgebra::Vector2;
use proptest::prelude::*;

use super::{Coverage, CoverageConfig, CoverageError, turn};

fn corners(places: &[(f64, f64)]) -> Vec<Vector2<f64>> {
    places.iter().map(|&(east, north)| Vector2::new(east, north)).collect()
}

/// From a place to the nearest side.
fn to_side(corners: &[Vector2<f64>], place: &Vector2<f64>) -> f64 {
    let sides = corners.iter().zip(corners.iter().cycle().skip(1));
    let distance = |(a, b): (&Vector2<f64>, &Vector2<f64>)| {
        let side = b - a;
        let along = ((place - a).dot(&side) / side.norm_squared()).clamp(0.0, 1.0);
        (place - (a + side * along)).norm()
    };
    sides.map(distance).fold(f64::INFINITY, f64::min)
}

/// Returns true if a place is inside, by the angle that the sides turn by about it.
fn inside(corners: &[Vector2<f64>], place: &Vector2<f64>) -> bool {
    let sides = corners.iter().zip(corners.iter().cycle().skip(1));
    let turned = |(a, b): (&Vector2<f64>, &Vector2<f64>)| {
        let a = a - place;
        let b = b - place;
        libm::atan2(a.perp(&b), a.dot(&b))
    };
    sides.map(turned).sum::<f64>().abs() > 3.0
}

/// The sweep of Pritzl 2018, §7.4.
#[test]
fn the_references_sixteen_places() {
    let field = corners(&[(0.0, 0.0), (65.0, 0.0), (65.0, 50.0), (0.0, 50.0)]);
    let coverage = Coverage::new(&field, &CoverageConfig::default()).expect("a field");
    let mut expected = Vec::new();
    for row in 0..4_u8 {
        for column in 0..4_u8 {
            let column = if row % 2 == 0 { column } else { 3 - column };
            let column = f64::from(column);
            let row = f64::from(row);
            expected.push(Vector2::new(6.0 + 53.0 * column / 3.0, 6.0 + 38.0 * row / 3.0));
        }
    }
    assert_eq!(coverage.places().len(), 16);
    for (place, expected) in coverage.places().iter().zip(&expected) {
        assert!((place - expected).norm() < 1e-6, "{place} is not {expected}");
    }
}

#[test]
fn the_first_corner_may_come_again_at_the_end() {
    let config = CoverageConfig::default();
    let field = corners(&[(0.0, 0.0), (65.0, 0.0), (65.0, 50.0), (0.0, 50.0)]);
    let closed = corners(&[(0.0, 0.0), (65.0, 0.0), (65.0, 50.0), (0.0, 50.0), (0.0, 0.0)]);
    assert_eq!(Coverage::new(&closed, &config), Coverage::new(&field, &config));
    let two = corners(&[(0.0, 0.0), (65.0, 0.0), (0.0, 0.0)]);
    assert_eq!(Coverage::new(&two, &config), Err(CoverageError::Corners { corners: 2 }));
}

/// Rows along North, from South to North at first, whichever way the sides are listed.
#[test]
fn rows_run_along_the_longest_side() {
    let mut tall = corners(&[(0.0, 0.0), (50.0, 0.0), (50.0, 65.0), (0.0, 65.0)]);
    for _ in 0..2 {
        for start in 0..4 {
            tall.rotate_left(1);
            let coverage = Coverage::new(&tall, &CoverageConfig::default()).expect("a field");
            let places = coverage.places();
            assert_eq!(places.len(), 16);
            let rows = [Vector2::new(44.0, 6.0), Vector2::new(44.0, 59.0)];
            for (place, expected) in [places[0], places[3]].iter().zip(rows) {
                assert!((place - expected).norm() < 1e-6, "start {start}: {place}");
            }
        }
        tall.reverse();
    }
}

/// A U whose arms are swept one after the other, with no place between them.
#[test]
fn an_area_that_is_not_convex_is_cut_into_cells() {
    let u = corners(&[
        (0.0, 0.0),
        (90.0, 0.0),
        (90.0, 60.0),
        (60.0, 60.0),
        (60.0, 20.0),
        (30.0, 20.0),
        (30.0, 60.0),
        (0.0, 60.0),
    ]);
    let config = CoverageConfig { row_spacing_m: 5.0, along_spacing_m: 5.0, ..Default::default() };
    let coverage = Coverage::new(&u, &CoverageConfig { margin_m: 3.0, ..config }).expect("a U");
    let between = |p: &&Vector2<f64>| (27.1..62.9).contains(&p.x) && p.y > 20.0;
    assert_eq!(coverage.places().iter().find(between), None);
    // The way jumps over the gap once only: from one arm to the other.
    let jumps = coverage.places().windows(2).filter(|pair| (pair[1] - pair[0]).norm() > 10.0);
    assert!(jumps.count() <= 2);
    // Every place that keeps the margin has a neighbour on a row.
    for east in 0..90_u8 {
        for north in 0..60_u8 {
            let place = Vector2::new(f64::from(east), f64::from(north));
            if inside(&u, &place) && to_side(&u, &place) > 3.0 {
                let near = coverage.places().iter().map(|p| (p - place).norm());
                let near = near.fold(f64::INFINITY, f64::min);
                assert!(near < 5.0, "{place} is {near} m from the sweep");
            }
        }
    }
}

#[test]
fn what_is_no_area_is_refused() {
    let sweep = |places: &[(f64, f64)]| {
        Coverage::new(&corners(places), &CoverageConfig { margin_m: 1.0, ..Default::default() })
    };
    assert_eq!(sweep(&[(0.0, 0.0), (9.0, 0.0)]), Err(CoverageError::Corners { corners: 2 }));
    let bow = sweep(&[(0.0, 0.0), (9.0, 9.0), (9.0, 0.0), (0.0, 9.0)]);
    assert_eq!(bow, Err(CoverageError::Crossing { first: 0, second: 2 }));
    let fold = sweep(&[(0.0, 0.0), (9.0, 0.0), (4.0, 0.0), (4.0, 9.0)]);
    assert!(matches!(fold, Err(CoverageError::Crossing { .. })), "{fold:?}");
    let thin = sweep(&[(0.0, 0.0), (90.0, 0.0), (90.0, 1.5), (0.0, 1.5)]);
    assert_eq!(thin, Err(CoverageError::NoRoom { margin_m: 1.0 }));
    let nowhere = sweep(&[(0.0, 0.0), (9.0, f64::NAN), (9.0, 9.0)]);
    assert!(matches!(nowhere, Err(CoverageError::NotFinite { .. })));
    let triangle = corners(&[(0.0, 0.0), (900.0, 0.0), (0.0, 900.0)]);
    for (config, field) in [
        (CoverageConfig { row_spacing_m: 0.0, ..Default::default() }, "row_spacing_m"),
        (CoverageConfig { row_spacing_m: 1e-9, ..Default::default() }, "row_spacing_m"),
        (CoverageConfig { along_spacing_m: 0.3, ..Default::default() }, "along_spacing_m"),
        (CoverageConfig { margin_m: -1.0, ..Default::default() }, "margin_m"),
        (CoverageConfig { direction_rad: Some(f64::NAN), ..Default::default() }, "direction_rad"),
    ] {
        match Coverage::new(&triangle, &config) {
            Err(CoverageError::Parameter(error)) => assert_eq!(error.name, field),
            other => panic!("{field}: {other:?}"),
        }
    }
}

proptest! {
    /// A star about the origin, of any corners, turned by any angle: every place is inside and
    /// keeps its margin, and neighbours on a row are near.
    #[test]
    fn every_place_is_inside_and_keeps_the_margin(
        radii in prop::collection::vec(20.0..100.0, 3..12),
        angle in -4.0..4.0,
        direction in prop::option::of(-4.0..4.0),
    ) {
        let step = core::f64::consts::TAU / crate::shape::number(radii.len());
        let star: Vec<_> = radii
            .iter()
            .enumerate()
            .map(|(i, &r)| turn(&Vector2::new(r, 0.0), angle + step * crate::shape::number(i)))
            .collect();
        let config = CoverageConfig { direction_rad: direction, ..Default::default() };
        let coverage = Coverage::new(&star, &CoverageConfig { margin_m: 2.0, ..config })
            .expect("a star of 20 m has room");
        for place in coverage.places() {
            prop_assert!(inside(&star, place), "{place} is outside");
            prop_assert!(to_side(&star, place) > 2.0 - 1e-6, "{place} is too near a side");
        }
    }
}
