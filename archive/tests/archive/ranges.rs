//! Ranges as radios measure them: clean, too long by what all of them share, by detours of some of
//! them, and read many times from each place.

use std::fmt::Write as _;

use foxhunt_archive::{
    recorded::{ReceptionConfig, receptions},
    recording::{ReadOptions, Recording},
};
use foxhunt_hunt::{
    locate::{LocateConfig, Located},
    registry::Registry,
};
use foxhunt_sensors::Pritzl2018;
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

/// Error of the ranges from one place, and that of a single range, in metres.
type Errors = fn(&mut Xoshiro256PlusPlus) -> f64;

fn normal(rng: &mut Xoshiro256PlusPlus) -> f64 {
    rng.sample(StandardNormal)
}

/// Ranges of nine receivers on a field of 40 m, `each` of every one of them, and where the
/// transmitter is.
fn drawn(seed: u64, each: u8, of_place: Errors, of_range: Errors) -> (String, Vector2<f64>) {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let target = Vector2::new(5.0 + 30.0 * rng.random::<f64>(), 5.0 + 30.0 * rng.random::<f64>());
    let mut table = String::from("time_s,drone,east_m,north_m,range_m,range_sigma_m\n");
    for anchor in 0..9_u8 {
        let east = 20.0 * f64::from(anchor % 3);
        let north = 20.0 * f64::from(anchor / 3) + 3.0 * f64::from(anchor % 2);
        let bias = of_place(&mut rng);
        for reading in 0..each {
            let way = target - Vector2::new(east, north);
            let range = (way.norm() + bias + of_range(&mut rng)).max(0.01);
            writeln!(table, "{reading},a{anchor},{east},{north},{range:.3},0.2").expect("a string");
        }
    }
    (table, target)
}

fn located(table: &str) -> Located {
    let recording = Recording::from_reader(table.as_bytes(), "drawn.csv", &ReadOptions::default());
    let recording = recording.expect("a table of ours");
    let config = ReceptionConfig::default();
    let received =
        receptions(&[recording], None, &Pritzl2018::default(), &config).expect("readable");
    let registry = Registry::builtin();
    let estimator = registry.estimator("multilateration").expect("registered");
    estimator.locate(&received, &LocateConfig::default()).expect("a place")
}

/// Median error in metres, the number of regions that hold, and of answers with each remark.
fn judged(draws: u64, each: u8, of_place: Errors, of_range: Errors) -> (f64, usize, Vec<String>) {
    let mut errors = Vec::new();
    let mut held = 0;
    let mut codes = Vec::new();
    for seed in 0..draws {
        let (table, target) = drawn(seed, each, of_place, of_range);
        let located = located(&table);
        errors.push((located.estimate.mean - target).norm());
        held += usize::from(located.region_95_holds(&target) == Some(true));
        codes.extend(located.remarks.iter().map(|remark| remark.code.to_string()));
    }
    errors.sort_by(f64::total_cmp);
    (errors[errors.len() / 2], held, codes)
}

#[test]
fn clean_ranges_stay_as_they_are() {
    let (median_m, held, codes) = judged(60, 1, |_| 0.0, |rng| 0.2 * normal(rng));
    assert!(median_m < 0.2 && held >= 53, "{median_m} m, {held}");
    assert!(codes.len() <= 2, "{codes:?}");
}

#[test]
fn an_offset_that_all_share_is_taken_off() {
    let (median_m, held, codes) = judged(60, 1, |_| 6.0, |rng| 0.2 * normal(rng));
    let found = codes.iter().filter(|code| *code == "ranges-share-bias").count();
    assert!(median_m < 0.3 && held >= 53 && found >= 57, "{median_m} m, {held}, {found}");
}

#[test]
fn detours_widen_the_region() {
    // One receiver of three is behind a wall: its ranges are 1 to 5 m too long.
    let behind = |rng: &mut Xoshiro256PlusPlus| match rng.random::<f64>() {
        u if u < 0.33 => 1.0 + 4.0 * rng.random::<f64>(),
        _ => 0.0,
    };
    for each in [1, 100] {
        let (median_m, held, _) = judged(60, each, behind, |rng| 0.2 * normal(rng));
        assert!(median_m < 1.4 && held >= 50, "{median_m} m, {held} with {each} from each place");
    }
}
