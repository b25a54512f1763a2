//! Raw sweeps to bearings, against the shared vectors.

use foxhunt_core::{BeaconId, NoBearing, Pose, Sample, Sweep, angle};
use foxhunt_sensors::{Cell, Pattern, Pritzl2018};
use serde_json::Value;

use crate::vectors::{all_numbers, number, numbers, vectors};

const TOLERANCE: f64 = 1e-9;

/// The source's rules alone, without the guards of the default.
fn unguarded() -> Pritzl2018 {
    let guarded = Pritzl2018::default();
    guarded.with_min_sigma(0.0).and_then(|e| e.with_min_positions(1)).expect("in range")
}

fn samples(case: &Value) -> Vec<Sample> {
    let raw = &case["samples"];
    let positions = raw["position"].as_array().expect("a list");
    let rows = positions.iter().zip(all_numbers(&raw["angle_rad"]));
    rows.zip(all_numbers(&raw["rssi_dbm"]))
        .map(|((position, boresight), rss_dbm)| Sample {
            time: 0.0,
            receiver: Pose::default(),
            boresight,
            position: position.as_u64().and_then(|p| u16::try_from(p).ok()).expect("a position"),
            rss_dbm,
        })
        .collect()
}

fn for_each_case(check: impl Fn(&str, &Sweep<'_>, &Value)) {
    let file = vectors("preprocess.json");
    let cases = file["cases"].as_array().expect("a list");
    assert_eq!(cases.len(), 12);
    for case in cases {
        let positions = case["n_positions"].as_u64().expect("a count");
        let sweep = Sweep {
            beacon: BeaconId(0),
            time: 0.0,
            receiver: Pose::default(),
            positions: u16::try_from(positions).expect("a few"),
            samples: &samples(case),
            ..Sweep::default()
        };
        check(case["name"].as_str().expect("a name"), &sweep, &case["expected"]);
    }
}

fn same(what: &str, i: usize, ours: Option<f64>, theirs: Option<f64>) {
    match (ours, theirs) {
        (None, None) => {}
        (Some(a), Some(b)) if (a - b).abs() < TOLERANCE => {}
        _ => panic!("{what} at {i} is {ours:?}, should be {theirs:?}"),
    }
}

fn same_angle(what: &str, ours: f64, theirs: f64) {
    assert!(angle::distance(ours, theirs) < TOLERANCE, "{what} is {ours}, should be {theirs}");
}

fn column(pattern: &Pattern, of: impl Fn(&Cell) -> Option<f64>) -> Vec<Option<f64>> {
    pattern.cells().iter().map(of).collect()
}

fn places(pattern: &Pattern, level: f64) -> Vec<u64> {
    let loud = |c: &Cell| c.rounded_dbm().is_some_and(|dbm| dbm >= level);
    (0..).zip(pattern.cells()).filter(|(_, cell)| loud(cell)).map(|(i, _)| i).collect()
}

fn indices(value: &Value) -> Vec<u64> {
    value.as_array().expect("a list").iter().map(|v| v.as_u64().expect("an index")).collect()
}

#[test]
fn every_field_of_the_pattern_agrees() {
    for_each_case(|name, sweep, expected| {
        let pattern = unguarded().pattern(sweep).expect("a proper sweep");
        same(&format!("{name}: rss"), 0, Some(pattern.rss_dbm()), number(&expected["rss_avg"]));
        for (field, ours) in [
            ("mean_rssi", column(&pattern, Cell::mean_dbm)),
            ("smoothed", column(&pattern, Cell::smoothed_dbm)),
        ] {
            let theirs = numbers(&expected[field]);
            assert_eq!(ours.len(), theirs.len());
            for (i, (ours, theirs)) in ours.into_iter().zip(theirs).enumerate() {
                same(&format!("{name}: {field}"), i, ours, theirs);
            }
        }
        let counts: Vec<u64> = pattern.cells().iter().map(|c| u64::from(c.count())).collect();
        assert_eq!(counts, indices(&expected["count"]), "{name}");
        let (mean, filled) =
            (numbers(&expected["mean_angle"]), numbers(&expected["angles_filled"]));
        for (i, cell) in pattern.cells().iter().enumerate() {
            if let Some(theirs) = mean[i] {
                same_angle(&format!("{name}: mean angle at {i}"), cell.angle(), theirs);
            }
            if let Some(theirs) = filled[i] {
                same_angle(&format!("{name}: filled angle at {i}"), cell.angle(), theirs);
            }
        }
        assert!(filled.iter().flatten().count() >= mean.iter().flatten().count());
    });
}

#[test]
fn rounding_agrees_and_ties_go_away_from_zero() {
    for_each_case(|name, sweep, expected| {
        let pattern = unguarded().pattern(sweep).expect("a proper sweep");
        let open = indices(&expected["rounding_ties"]);
        let theirs = numbers(&expected["rounded"]);
        for (i, (cell, theirs)) in (0_u64..).zip(pattern.cells().iter().zip(theirs)) {
            if open.contains(&i) {
                let (smoothed, rounded) = (cell.smoothed_dbm(), cell.rounded_dbm());
                let (smoothed, rounded) = smoothed.zip(rounded).expect("a tie has a value");
                assert!((smoothed - rounded - 0.5).abs() < 1e-9, "{name}: {smoothed} at {i}");
            } else {
                same(&format!("{name}: rounded"), 0, cell.rounded_dbm(), theirs);
            }
        }
    });
}

#[test]
fn bearing_and_sigma_agree() {
    for_each_case(|name, sweep, expected| {
        let extractor = unguarded();
        let pattern = extractor.pattern(sweep).expect("a proper sweep");
        let maximum = pattern.maximum_dbm();
        same(&format!("{name}: max"), 0, Some(maximum), number(&expected["max"]));
        assert_eq!(places(&pattern, maximum), indices(&expected["ties"]), "{name}");
        match extractor.bearing(&pattern) {
            Ok(bearing) => {
                assert_eq!(expected["valid"], true, "{name}");
                same_angle(name, bearing.angle, number(&expected["aoa"]).expect("a bearing"));
                same(name, 0, Some(bearing.sigma), number(&expected["sigma_theta"]));
                assert_eq!(places(&pattern, maximum - 2.0), indices(&expected["top"]), "{name}");
            }
            Err(NoBearing::Ambiguous { .. }) => assert_eq!(expected["valid"], false, "{name}"),
            Err(other) => panic!("{name}: {other}"),
        }
    });
}

#[test]
fn the_defaults_guard_against_a_turn_that_received_one_position() {
    for_each_case(|name, sweep, _| {
        let extractor = Pritzl2018::default();
        let pattern = extractor.pattern(sweep).expect("a proper sweep");
        let sparse = matches!(extractor.bearing(&pattern), Err(NoBearing::TooSparse { .. }));
        assert_eq!(sparse, name == "single_position", "{name}");
    });
}
