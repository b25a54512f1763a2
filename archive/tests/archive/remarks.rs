//! Remarks on answers: each kind of doubt is found in recordings of its kind, and clean recordings
//! have none.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use std::path::Path;

use foxhunt_archive::{
    recorded::{ReceptionConfig, receptions, recorded_truth},
    recording::{ReadOptions, Recording},
};
use foxhunt_core::{
    Bearing, Level, Measured, MeasuredList, Pose, Quantity, Reception, Receptions, angle,
};
use foxhunt_hunt::{
    calibration::{ConformalFactors, Deviation},
    locate::{LocateConfig, Located, Residual, learn_bearing_sigma},
    registry::Registry,
};
use foxhunt_sensors::Pritzl2018;
use nalgebra::{Vector2, Vector3};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

fn recorded(name: &str) -> Recording {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/doubts");
    Recording::read(folder.join(name), &ReadOptions::default()).expect("it can be read")
}

fn received(recording: &Recording, beacon: Option<&str>) -> Vec<Reception> {
    let of_one = std::slice::from_ref(recording);
    receptions(of_one, beacon, &Pritzl2018::default(), &ReceptionConfig::default())
        .expect("they are of use")
        .iter()
        .collect()
}

fn locate(receptions: &[Reception], estimator: &str, config: &LocateConfig) -> Located {
    let registry = Registry::builtin();
    let entry = registry.estimator(estimator).expect("it has a name");
    entry.locate(&receptions.into(), config).expect("it is located")
}

fn codes(located: &Located) -> Vec<&str> {
    located.remarks.iter().map(|remark| &*remark.code).collect()
}

fn text<'a>(located: &'a Located, code: &str) -> &'a str {
    let of_code = located.remarks.iter().find(|remark| remark.code == code);
    of_code.map_or_else(|| panic!("no {code}: {:?}", located.remarks), |remark| &remark.text)
}

/// Numbers of the settings in which σ of bearings is 10° for want of another.
fn with_assumed_sigma() -> LocateConfig {
    let assumed_bearing_sigma = Some(ReceptionConfig::default().bearing_sigma);
    LocateConfig { assumed_bearing_sigma, ..LocateConfig::default() }
}

fn normal(rng: &mut Xoshiro256PlusPlus) -> f64 {
    rng.sample(StandardNormal)
}

fn place(rng: &mut Xoshiro256PlusPlus, side: f64) -> Vector2<f64> {
    Vector2::new(side * rng.random::<f64>(), side * rng.random::<f64>())
}

fn bearing(from: Vector2<f64>, angle: f64, sigma: f64) -> Reception {
    Reception {
        receiver: Pose::at(from.x, from.y, 0.0),
        bearing: Some(Bearing { angle, sigma, confidence: 1.0 }),
        ..Reception::default()
    }
}

/// Bearings of a transmitter from places about it, off by σ `true_deg` where `stated_deg` is
/// stated.
fn about(
    rng: &mut Xoshiro256PlusPlus,
    target: Vector2<f64>,
    (count, true_deg, stated_deg): (u32, f64, f64),
) -> Vec<Reception> {
    let turned = rng.random::<f64>();
    let from = |number: u32, rng: &mut Xoshiro256PlusPlus| {
        let turn = f64::from(number) / f64::from(count) + turned + 0.05 * normal(rng);
        let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
        let from = target + Vector2::new(cos, sin) * (500.0 + 700.0 * rng.random::<f64>());
        let way = target - from;
        let error = true_deg.to_radians() * normal(rng);
        bearing(from, angle::wrap(way.y.atan2(way.x) + error), stated_deg.to_radians())
    };
    (0..count).map(|number| from(number, rng)).collect()
}

fn turn(reception: &mut Reception, deg: f64) {
    if let Some(bearing) = &mut reception.bearing {
        bearing.angle = angle::wrap(bearing.angle + deg.to_radians());
    }
}

#[test]
fn bearings_that_diverge_are_said_to_meet_reversed() {
    let config = LocateConfig::default();
    let mut received = received(&recorded("diverge_sigma.csv"), None);
    let located = locate(&received, "bearing-grid", &config);
    let text_of = text(&located, "bearings-do-not-meet");
    assert!(text_of.contains("reversed they meet at 250.0 m East, -144.3 m North"), "{text_of}");
    received.iter_mut().for_each(|reception| turn(reception, 180.0));
    assert_eq!(codes(&locate(&received, "bearing-grid", &config)), [""; 0]);
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    for draw in 0..3 {
        let target = place(&mut rng, 2000.0);
        let mut received = about(&mut rng, target, (3 + draw, 4.0, 5.0));
        received.iter_mut().for_each(|reception| turn(reception, 180.0));
        for estimator in ["bearing-grid", "particle"] {
            let located = locate(&received, estimator, &config);
            let text = text(&located, "bearings-do-not-meet");
            assert!(text.contains("; reversed they meet at"), "{estimator}: {text}");
        }
        received.iter_mut().for_each(|reception| turn(reception, 180.0));
        assert_eq!(codes(&locate(&received, "bearing-grid", &config)), [""; 0], "{draw}");
    }
}

#[test]
fn the_one_bearing_that_is_wrong_is_named_and_left_out() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(2);
    for (sigma_deg, config) in [(5.0, LocateConfig::default()), (10.0, with_assumed_sigma())] {
        for draw in 0..10 {
            let target = place(&mut rng, 2000.0);
            let mut received = about(&mut rng, target, (8, 5.0, sigma_deg));
            let clean = locate(&received, "bearing-grid", &config);
            let wrong = draw % 8;
            turn(&mut received[wrong], if draw % 2 == 0 { 71.0 } else { -71.0 });
            let located = locate(&received, "bearing-grid", &config);
            let text = text(&located, "outlier");
            assert!(text.starts_with(&format!("bearing {} of 8", wrong + 1)), "{text}");
            assert!(text.ends_with("it was left out"), "{text}");
            assert_eq!(located.rejected, 1);
            let moved = (located.estimate.mean - clean.estimate.mean).norm();
            assert!(moved < 60.0, "{draw}: {moved} m");
            // Others say where the place would be.
            let other = locate(&received, "pseudolinear", &config);
            let said = self::text(&other, "outlier");
            assert!(said.contains("without the outliers the place would be at"), "{said}");
        }
    }
}

#[test]
fn remarks_name_file_and_line_and_each_row_has_its_residual() {
    let registry = Registry::builtin();
    let config = LocateConfig::default();
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(11);
    for draw in 0..4 {
        let target = place(&mut rng, 2000.0);
        let mut received = about(&mut rng, target, (8, 5.0, 5.0));
        let wrong = 2 * draw;
        turn(&mut received[wrong], 71.0);
        for (estimator, leaves_out) in [("bearing-grid", true), ("pseudolinear", false)] {
            let entry = registry.estimator(estimator).expect("built in");
            let name = |index: usize| Some(format!("a.csv, line {}", index + 2));
            let located = entry
                .locate_named(&Receptions::from(&*received), &config, &name)
                .expect("it is located");
            let text = text(&located, "outlier");
            let begin = format!("the bearing of a.csv, line {} (", wrong + 2);
            assert!(text.starts_with(&begin), "{text}");
            let rows = entry.residuals(&located, &Receptions::from(&*received), &config);
            assert_eq!(rows.len(), 8);
            if leaves_out {
                let p = |row: &Residual| row.p.expect("seven others test it");
                let least = rows.iter().min_by(|a, b| p(a).total_cmp(&p(b))).expect("eight rows");
                let p = p(least);
                assert_eq!(least.reception, wrong, "{estimator}: {rows:?}");
                let away = (least.residual.to_degrees() - 71.0).abs();
                assert!(p < 1e-4 && away < 15.0, "{estimator}: {least:?}");
            }
            let left_out: Vec<usize> =
                rows.iter().filter(|row| row.left_out).map(|row| row.reception).collect();
            assert_eq!(left_out, if leaves_out { vec![wrong] } else { Vec::new() });
        }
    }
}

/// p of clean rows is uniform: 5 % of the rows are below 0.05, within 3.29 σ of a binomial number,
/// and the quarters hold as many each. True σ of bearings is as uncertain as the
/// examination takes it to be: worth eight measurements.
#[test]
fn p_of_clean_rows_is_uniform() {
    let registry = Registry::builtin();
    let config = LocateConfig::default();
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(12);
    let bearings = |rng: &mut Xoshiro256PlusPlus| {
        let target = place(rng, 2000.0);
        let square: f64 = (0..8).map(|_| normal(rng).powi(2)).sum::<f64>() / 8.0;
        about(rng, target, (8, 2.0 / square.sqrt(), 2.0))
    };
    let of_levels = |rng: &mut Xoshiro256PlusPlus| {
        let target = Vector2::new(100.0, 100.0) + place(rng, 250.0);
        levels(rng, target)
    };
    type Draw<'a> = &'a dyn Fn(&mut Xoshiro256PlusPlus) -> Vec<Reception>;
    let kinds: [(&str, usize, Draw<'_>); 2] =
        [("pseudolinear", 300, &bearings), ("least-absolute", 15, &of_levels)];
    for (estimator, draws, draw) in kinds {
        let entry = registry.estimator(estimator).expect("built in");
        let mut values = Vec::new();
        for _ in 0..draws {
            let received = draw(&mut rng);
            let located =
                entry.locate(&Receptions::from(&*received), &config).expect("it is located");
            let rows = entry.residuals(&located, &Receptions::from(&*received), &config);
            assert_eq!(rows.len(), received.len());
            values.extend(rows.iter().filter_map(|row| row.p));
        }
        let count = f64::from(u32::try_from(values.len()).expect("few"));
        for (low, high) in [(0.0, 0.05), (0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.0)] {
            let inside = values.iter().filter(|p| (low..=high).contains(*p)).count();
            let share = f64::from(u32::try_from(inside).expect("few")) / count;
            let expected: f64 = high - low;
            let sigma = (expected * (1.0 - expected) / count).sqrt();
            let off = (share - expected) / sigma;
            assert!(off.abs() < 3.29, "{estimator}: {share:.4} in {low} to {high}, {off:.1} σ");
        }
    }
}

/// True σ of bearings is twice the stated one. Regions scaled by 99 fixes with a known truth hold
/// 95 % of 400 others, within 3.29 σ of what both numbers vary by; the ellipses do not.
#[test]
fn conformal_regions_hold_where_stated_sigma_is_half_the_true_one() {
    let registry = Registry::builtin();
    let entry = registry.estimator("pseudolinear").expect("built in");
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(13);
    let mut draw = || {
        let target = place(&mut rng, 2000.0);
        let received = about(&mut rng, target, (6, 6.0, 3.0));
        let located = entry
            .locate(&Receptions::from(&*received), &LocateConfig::default())
            .expect("it is located");
        let deviation = Deviation::new(&located, &target).expect("it has an ellipse");
        (deviation, located.ellipse_95_holds(&target) == Some(true))
    };
    let own: Vec<Deviation> = (0..99).map(|_| draw().0).collect();
    let factors = ConformalFactors::new("pseudolinear", &own).expect("enough");
    let fixes = 400;
    let mut held = [0.0; 3];
    for _ in 0..fixes {
        let (deviation, in_ellipse) = draw();
        let [ellipse, circle] = factors.hold(&deviation);
        for (sum, holds) in held.iter_mut().zip([ellipse, circle, in_ellipse]) {
            *sum += f64::from(u8::from(holds));
        }
    }
    let count = f64::from(fixes);
    let [ellipse, circle, own] = held.map(|held| held / count);
    let interval = 3.29 * (0.95 * 0.05 * (1.0 / count + 1.0 / 101.0)).sqrt();
    for share in [ellipse, circle] {
        assert!(abs_diff_eq!(share, 0.95, epsilon = interval), "{share} ± {interval}");
    }
    assert!(own < 0.95 - interval && own < 0.75, "{own}");
}

/// 400 draws of clean bearings each: at most 1 % have a remark on their fit, by 3.29 σ of that
/// number.
#[test]
fn clean_bearings_have_no_remark() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
    for (true_deg, stated_deg, config) in [
        (5.0, 5.0, LocateConfig::default()),
        (5.0, 10.0, with_assumed_sigma()),
        (14.0, 10.0, with_assumed_sigma()),
    ] {
        let mut alarms = Vec::new();
        for draw in 0..400 {
            let target = place(&mut rng, 2000.0);
            let count = 3 + draw % 7;
            let received = about(&mut rng, target, (count, true_deg, stated_deg));
            let entry = if draw % 4 == 0 { "bearing-grid" } else { "pseudolinear" };
            let located = locate(&received, entry, &config);
            let is_of_fit =
                |code: &&str| !["ellipse-is-poor", "border", "does-not-fit"].contains(code);
            alarms.extend(
                codes(&located).into_iter().filter(is_of_fit).map(|c| (count, c.to_owned())),
            );
        }
        assert!(alarms.len() <= 10, "{stated_deg}: {alarms:?}");
    }
}

#[test]
fn everything_from_one_place_leaves_the_range_open() {
    let received = received(&recorded("same_place.csv"), None);
    for margin_m in [200.0, 2000.0, 20_000.0] {
        let config = LocateConfig { margin_m, ..LocateConfig::default() };
        let located = locate(&received, "particle", &config);
        assert!(text(&located, "one-place").contains("only the direction is known, 5"));
    }
    // 60° with σ 5° weighs four times as much as 120° with 10°.
    let two = [(60.0_f64, 5.0_f64), (120.0, 10.0)].map(|(compass, sigma)| {
        let angle = (90.0 - compass).to_radians();
        let bearing = Bearing { angle, sigma: sigma.to_radians(), confidence: 1.0 };
        Reception { bearing: Some(bearing), ..Reception::default() }
    });
    let located = locate(&two, "particle", &LocateConfig::default());
    assert!(text(&located, "one-place").contains("only the direction is known, 71°"));
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
    let config = LocateConfig::default();
    for _ in 0..3 {
        let target = place(&mut rng, 2000.0);
        let mut received = about(&mut rng, target, (4, 5.0, 5.0));
        assert!(!codes(&locate(&received, "particle", &config)).contains(&"one-place"));
        let first = received[0];
        for reception in &mut received {
            let shift = 0.2 * normal(&mut rng);
            let error = 0.05 * normal(&mut rng);
            *reception = first;
            reception.receiver.position.x += shift;
            turn(reception, error.to_degrees());
        }
        assert!(codes(&locate(&received, "particle", &config)).contains(&"one-place"));
    }
}

#[test]
fn bearings_from_a_short_baseline_leave_the_distance_open() {
    let config = LocateConfig::default();
    let received = received(&recorded("far_transmitter.csv"), None);
    let located = locate(&received, "bearing-grid", &config);
    let said = text(&located, "range-open");
    assert!(said.contains("direction 0°, at least 2"), "{said}");
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
    for draw in 0..3 {
        let far = Vector2::new(500.0, 9000.0);
        let along = |target: Vector2<f64>, rng: &mut Xoshiro256PlusPlus| -> Vec<Reception> {
            let of = |east: f64, rng: &mut Xoshiro256PlusPlus| {
                let from = Vector2::new(east, 0.0);
                let way = target - from;
                let sigma = 3.0_f64.to_radians();
                bearing(from, way.y.atan2(way.x) + 0.5 * sigma * normal(rng), sigma)
            };
            (0..3 + draw).map(|i| of(1000.0 * f64::from(i) / f64::from(2 + draw), rng)).collect()
        };
        let received = along(far, &mut rng);
        assert!(codes(&locate(&received, "bearing-grid", &config)).contains(&"range-open"));
        let received = along(Vector2::new(400.0, 500.0), &mut rng);
        assert_eq!(codes(&locate(&received, "bearing-grid", &config)), [""; 0]);
    }
}

#[test]
fn bearings_over_140_km_meet_where_the_transmitter_is() {
    let recording = recorded("convergence.csv");
    let received = received(&recording, None);
    let truth = recorded_truth(&[recording], None).expect("it has one");
    let located = locate(&received, "lenth1981", &LocateConfig::default());
    let error_m = (located.estimate.mean - truth).norm();
    assert!(error_m < 10.0, "{error_m} m");
    assert_eq!(codes(&located), [""; 0]);
}

#[test]
fn both_places_of_two_range_differences_are_listed() {
    let config = LocateConfig { reference_m: Some(Vector3::zeros()), ..LocateConfig::default() };
    let recording = recorded("tdoa_two_solutions.csv");
    let located = locate(&received(&recording, None), "range-differences", &config);
    let truth = recorded_truth(&[recording], None).expect("it has one");
    assert!(text(&located, "rivals").contains("-300.0 m East, -200.0 m North"));
    let [rival] = &located.rivals[..] else { panic!("{:?}", located.rivals) };
    assert!((rival.place - truth).norm() < 0.1 && rival.relative_density > 0.9, "{rival:?}");
    assert_eq!(located.regions_95.len(), 2);
    assert_eq!(located.region_95_holds(&truth), Some(true));
    // A third difference decides.
    let third = Vector3::new(-1000.0, -400.0, 0.0);
    let far = |from: &Vector3<f64>| (truth.push(0.0) - from).norm();
    let value = far(&third) - far(&Vector3::zeros());
    let difference = Measured::new(Quantity::RANGE_DIFFERENCE, value, 3.0).expect("finite");
    let more = Reception {
        receiver: Pose::at(third.x, third.y, third.z),
        measured: MeasuredList::new(&[difference]).expect("one fits"),
        ..Reception::default()
    };
    let mut received = received(&recorded("tdoa_two_solutions.csv"), None);
    received.push(more);
    let located = locate(&received, "range-differences", &config);
    assert_eq!(codes(&located), [""; 0]);
    assert!((located.estimate.mean - truth).norm() < 1.0);
}

#[test]
fn ranges_from_a_line_have_a_mirrored_rival_with_a_region() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(6);
    for draw in 0..3 {
        let target = place(&mut rng, 500.0) + Vector2::new(0.0, 100.0);
        let of = |number: i32, rng: &mut Xoshiro256PlusPlus| {
            let from = Vector2::new(200.0 * f64::from(number), 0.0);
            let value = (target - from).norm() + 2.0 * normal(rng);
            let range = Measured::new(Quantity::RANGE, value, 2.0).expect("finite");
            Reception {
                receiver: Pose::at(from.x, from.y, 0.0),
                measured: MeasuredList::new(&[range]).expect("one fits"),
                ..Reception::default()
            }
        };
        let received: Vec<Reception> = (0..4).map(|i| of(i, &mut rng)).collect();
        let located = locate(&received, "multilateration", &LocateConfig::default());
        let mirrored = Vector2::new(target.x, -target.y);
        assert_eq!(located.regions_95.len(), 2, "{draw}");
        for place in [&target, &mirrored] {
            assert_eq!(located.region_95_holds(place), Some(true), "{draw}");
        }
        assert!(codes(&located).contains(&"rivals"));
    }
}

/// Two of 30 animals with back-bearings teach no σ, and are said to be reversed; the others are as
/// good as if alone.
#[test]
fn reversed_animals_spoil_no_others() {
    let bad = recorded("groups_2bad.csv");
    let good = recorded("groups_good.csv");
    let learned = |recording: &Recording| {
        let of = |beacon| Receptions::from(&*received(recording, beacon));
        let each: Vec<Receptions> = recording.beacons().into_iter().map(of).collect();
        learn_bearing_sigma(&each, &with_assumed_sigma())
    };
    let names = bad.beacons();
    let of_bad = learned(&bad);
    let left_out: Vec<_> =
        of_bad.left_out.iter().map(|index| names[*index].expect("named")).collect();
    assert_eq!(left_out, ["g0", "g1"]);
    let of_good = learned(&good);
    assert!(of_good.left_out.is_empty(), "{of_good:?}");
    assert_abs_diff_eq!(of_bad.factor / of_good.factor, 1.0, epsilon = 0.1);
    let sigma = ReceptionConfig::default().bearing_sigma * of_bad.factor;
    assert_abs_diff_eq!(sigma.to_degrees(), 3.0, epsilon = 0.2);
    let config = LocateConfig { bearing_freedom: of_bad.freedom, ..LocateConfig::default() };
    let mut errors = Vec::new();
    for beacon in names {
        let mut received = received(&bad, beacon);
        for reception in &mut received {
            reception.bearing = reception.bearing.map(|bearing| Bearing { sigma, ..bearing });
        }
        let located = locate(&received, "bearing-grid", &config);
        if matches!(beacon, Some("g0" | "g1")) {
            assert!(text(&located, "bearings-do-not-meet").contains("; reversed they meet at"));
            continue;
        }
        assert!(!codes(&located).contains(&"bearings-do-not-meet"), "{beacon:?}");
        let truth = recorded_truth(std::slice::from_ref(&bad), beacon).expect("it has one");
        errors.push((located.estimate.mean - truth).norm());
    }
    errors.sort_by(f64::total_cmp);
    assert!(errors[errors.len() / 2] < 45.0, "{errors:?}");
}

/// Levels of a flight over a square with white noise of 4 dB.
fn levels(rng: &mut Xoshiro256PlusPlus, target: Vector2<f64>) -> Vec<Reception> {
    levels_every(25.0, rng, target)
}

/// Levels of ten lanes 50 m apart, of twenty steps each.
fn levels_every(step_m: f64, rng: &mut Xoshiro256PlusPlus, target: Vector2<f64>) -> Vec<Reception> {
    let level = |number: i32, rng: &mut Xoshiro256PlusPlus| {
        let lane = number / 20;
        let along = number % 20;
        let along = if lane % 2 == 0 { along } else { 19 - along };
        let from = Vector2::new(step_m * f64::from(along), 50.0 * f64::from(lane));
        let range = (target - from).norm().hypot(30.0);
        let rss_dbm = -30.0 - 23.0 * range.log10() + 4.0 * normal(rng);
        Reception {
            time: f64::from(number),
            receiver: Pose::at(from.x, from.y, 30.0),
            level: Some(Level { rss_dbm, sigma_db: 8.0 }),
            ..Reception::default()
        }
    };
    (0..200).map(|number| level(number, rng)).collect()
}

#[test]
fn a_level_that_is_far_too_strong_is_named_and_clean_levels_have_no_remark() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(7);
    let config = LocateConfig::default();
    let mut alarms = Vec::new();
    for _ in 0..60 {
        let target = Vector2::new(100.0, 100.0) + place(&mut rng, 250.0);
        let received = levels(&mut rng, target);
        let located = locate(&received, "least-absolute", &config);
        alarms.extend(codes(&located).into_iter().map(str::to_owned));
    }
    // 1 % of 60, and 3.29 σ of it.
    assert!(alarms.len() <= 3, "{alarms:?}");
    for draw in 0..3 {
        let target = Vector2::new(100.0, 100.0) + place(&mut rng, 250.0);
        let mut received = levels(&mut rng, target);
        let wrong = 40 + 50 * draw;
        if let Some(level) = &mut received[wrong].level {
            level.rss_dbm = -10.0;
        }
        let located = locate(&received, "least-absolute", &config);
        let said = text(&located, "outlier");
        assert!(said.starts_with(&format!("reception {} (-10.0 dBm)", wrong + 1)), "{said}");
    }
}

#[test]
fn levels_that_stand_apart_on_both_sides_are_left_out_and_named() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(13);
    let config = LocateConfig::default();
    let registry = Registry::builtin();
    let entry = registry.estimator("shadowing-grid").expect("built in");
    for _ in 0..3 {
        let target = Vector2::new(20.0, 100.0) + place(&mut rng, 100.0);
        let mut received = levels_every(6.0, &mut rng, target);
        let wrong: Vec<usize> = (4..received.len()).step_by(8).collect();
        for (number, index) in wrong.iter().enumerate() {
            if let Some(level) = &mut received[*index].level {
                level.rss_dbm += if number.is_multiple_of(2) { 40.0 } else { -40.0 };
            }
        }
        let received = Receptions::from(&*received);
        let name = |index: usize| Some(format!("a.csv, line {}", index + 2));
        let located = entry.locate_named(&received, &config, &name).expect("it is located");
        assert_eq!((located.rejected, &located.levels_left_out), (wrong.len(), &wrong));
        assert_eq!(located.observations, received.len() - wrong.len());
        let said = text(&located, "outlier");
        assert!(
            said.starts_with(&format!("{} of {} levels", wrong.len(), received.len())),
            "{said}"
        );
        assert!(said.contains("a.csv, line 6 ("), "{said}");
        assert_eq!(codes(&located).iter().filter(|code| **code == "outlier").count(), 1);
        let rows = entry.residuals(&located, &received, &config);
        let left_out = rows.iter().filter(|row| row.left_out).map(|row| row.reception);
        assert_eq!(left_out.collect::<Vec<_>>(), wrong);
    }
}

#[test]
fn a_filter_that_is_lost_does_not_fit_the_levels() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(8);
    for _ in 0..3 {
        let target = Vector2::new(100.0, 100.0) + place(&mut rng, 250.0);
        let received = levels(&mut rng, target);
        let right = locate(&received, "shadowing-grid", &LocateConfig::default());
        assert!(!codes(&right).contains(&"does-not-fit"), "{:?}", right.remarks);
        // An estimator of one's own that answers a corner whatever was received.
        let lost = foxhunt_hunt::registry::EstimatorEntry::at_once(
            "corner",
            "the corner",
            "",
            Registry::builtin().estimator("strongest").expect("built in").needs().clone(),
            Corner,
        );
        let located = lost
            .locate(&Receptions::from(&*received), &LocateConfig::default())
            .expect("it is located");
        let said = text(&located, "does-not-fit");
        assert!(said.contains("take another estimator"), "{said}");
    }
}

struct Corner;

impl foxhunt_hunt::locate::Locator for Corner {
    fn locate(
        &self,
        _: &Receptions,
        _: &LocateConfig,
    ) -> Result<Located, foxhunt_hunt::locate::LocateError> {
        Ok(Located::at(foxhunt_core::Estimate::isotropic(Vector2::new(480.0, 470.0), 10.0)))
    }
}

/// Three to seven levels of a short walk fix no place, however they rise.
#[test]
fn a_few_levels_of_a_short_walk_leave_the_range_open() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(9);
    for draw in 0..24_i32 {
        let target = Vector2::new(120.0, 60.0) + place(&mut rng, 80.0);
        let received = |step_m: f64, rng: &mut Xoshiro256PlusPlus| -> Vec<Reception> {
            let level = |number: i32| {
                let from = Vector2::new(step_m * f64::from(number), 0.0);
                let range = (target - from).norm();
                // A walk through a shadow's edge rises by 2 dB a step.
                let shadow = 2.0 * f64::from(number) + normal(rng);
                let rss_dbm = -30.0 - 30.0 * range.log10() + shadow;
                Reception {
                    time: f64::from(number),
                    receiver: Pose::at(from.x, from.y, 0.0),
                    level: Some(Level { rss_dbm, sigma_db: 8.0 }),
                    ..Reception::default()
                }
            };
            (0..3 + draw % 5).map(level).collect()
        };
        let located = locate(&received(5.0, &mut rng), "shadowing-grid", &LocateConfig::default());
        assert!(codes(&located).contains(&"range-open"), "{draw}: {:?}", located.remarks);
    }
}

/// Errors of the receiver's places about one place make bearings cross at its feet.
#[test]
fn bearings_that_cross_where_the_receiver_stands_leave_the_range_open() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(10);
    let config = LocateConfig::default();
    for draw in 0..60_i32 {
        let sigma = 5.0_f64.to_radians();
        let received: Vec<Reception> = (0..3 + draw % 4)
            .map(|_| {
                let from = Vector2::new(normal(&mut rng), normal(&mut rng));
                bearing(from, 2.0 + sigma * normal(&mut rng), sigma)
            })
            .collect();
        let located = locate(&received, "bearing-grid", &config);
        let codes = codes(&located);
        assert!(
            codes.iter().any(|code| matches!(*code, "range-open" | "one-place")),
            "{draw}: {codes:?} {}",
            located.estimate.mean
        );
    }
}

/// Receptions of one quantity.
fn of_quantity(quantity: Quantity) -> Receptions {
    let measured = Measured::new(quantity, 40.0, 3.0).expect("finite");
    let one = Reception {
        measured: MeasuredList::new(&[measured]).expect("one fits"),
        ..Reception::default()
    };
    Receptions::from(&[one; 3][..])
}

#[test]
fn the_estimator_follows_from_what_was_received() {
    let registry = Registry::builtin();
    for (quantity, name) in [
        (Quantity::RANGE, "multilateration"),
        (Quantity::RANGE_DIFFERENCE, "range-differences"),
        (Quantity::RSS_DIFFERENCE, "level-difference"),
    ] {
        let suited = registry.suited_to(&of_quantity(quantity)).expect("built in");
        assert_eq!(suited.name, name);
    }
}

/// Differences of seven receivers to a reference, with an error of the reference's arrival.
fn differences(
    rng: &mut Xoshiro256PlusPlus,
    target: Vector2<f64>,
    own_m: f64,
    shared_m: f64,
) -> Vec<Reception> {
    let reference = Vector2::new(500.0, 500.0);
    let of_reference = shared_m * normal(rng);
    let sigma = own_m.hypot(shared_m);
    let of = |number: i32| {
        let angle = 0.9 * f64::from(number);
        let from = reference + Vector2::new(angle.cos(), angle.sin()) * (420.0 + 9.0 * angle);
        let true_m = (target - from).norm() - (target - reference).norm();
        let value = true_m + of_reference + own_m * normal(rng);
        let difference = Measured::new(Quantity::RANGE_DIFFERENCE, value, sigma).expect("finite");
        Reception {
            receiver: Pose::at(from.x, from.y, 0.0),
            measured: MeasuredList::new(&[difference]).expect("one fits"),
            ..Reception::default()
        }
    };
    (0..7).map(of).collect()
}

/// 400 draws each: ellipses of 95 % hold within 3.29 σ of a binomial number, whether each
/// difference has an error of its own or all have the reference's.
#[test]
fn range_differences_may_share_the_error_of_the_reference() {
    let reference_m = Some(Vector3::new(500.0, 500.0, 0.0));
    let config = LocateConfig { reference_m, ..LocateConfig::default() };
    for (own_m, shared_m) in [(5.0, 0.0), (5.0, 5.0)] {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(11);
        let holds = |_| {
            let target = place(&mut rng, 1000.0);
            let received = differences(&mut rng, target, own_m, shared_m);
            let located = locate(&received, "range-differences", &config);
            located.region_95_holds(&target) == Some(true)
        };
        let held = (0..400).map(holds).filter(|holds| *holds).count();
        assert!((366..=396).contains(&held), "{shared_m}: {held}");
    }
}

#[test]
fn a_range_difference_that_no_place_has_is_left_out() {
    let reference_m = Some(Vector3::new(500.0, 500.0, 0.0));
    let config = LocateConfig { reference_m, ..LocateConfig::default() };
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(12);
    for wrong in [0, 3, 6] {
        let target = place(&mut rng, 1000.0);
        let mut received = differences(&mut rng, target, 3.0, 0.0);
        let impossible = Measured::new(Quantity::RANGE_DIFFERENCE, 3700.0, 4.0).expect("finite");
        received[wrong].measured = MeasuredList::new(&[impossible]).expect("one fits");
        let located = locate(&received, "range-differences", &config);
        let said = text(&located, "outlier");
        assert!(said.contains(&format!("range difference {} of 7", wrong + 1)), "{said}");
        assert_eq!(codes(&located), ["outlier"]);
        assert_eq!((&located.left_out[..], located.rejected), (&[wrong][..], 1));
        assert!((located.estimate.mean - target).norm() < 20.0, "{}", located.estimate.mean);
    }
}
