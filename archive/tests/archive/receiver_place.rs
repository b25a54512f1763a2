//! Places of receivers that are not known exactly: as satellites give them, as a column states
//! them, and where they are all that moves.

use approx::assert_abs_diff_eq;
use std::fmt::Write as _;

use foxhunt_archive::{
    recorded::{GNSS_SIGMA_M, ReceptionConfig, receptions},
    recording::{ReadOptions, Recording},
};
use foxhunt_core::Reception;
use foxhunt_hunt::{
    locate::{LocateConfig, Located},
    registry::Registry,
};
use foxhunt_sensors::Pritzl2018;
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

fn received(table: &str, config: &ReceptionConfig) -> Vec<Reception> {
    let options = ReadOptions::default();
    let recording = Recording::from_reader(table.as_bytes(), "drawn.csv", &options);
    let recording = recording.expect("a table of ours");
    receptions(&[recording], None, &Pritzl2018::default(), config)
        .expect("readable")
        .iter()
        .collect()
}

fn sigmas(table: &str, receiver_sigma_m: Option<f64>) -> Vec<Option<f64>> {
    let config = ReceptionConfig { receiver_sigma_m, ..ReceptionConfig::default() };
    received(table, &config).iter().map(|r| r.receiver_sigma_m.map(|sigma| sigma.x)).collect()
}

#[test]
fn a_place_is_as_certain_as_its_column_the_flag_or_satellites_say() {
    let degrees = "lat_deg,lon_deg,rss_dbm\n48,16,-70\n48.001,16,-71\n";
    assert_eq!(sigmas(degrees, None), [Some(GNSS_SIGMA_M); 2]);
    assert_eq!(sigmas(degrees, Some(0.5)), [Some(0.5); 2]);
    let metres = "east_m,north_m,rss_dbm\n0,0,-70\n10,0,-71\n";
    assert_eq!(sigmas(metres, None), [None; 2]);
    let column = "east_m,north_m,receiver_sigma_m,rss_dbm\n0,0,7,-70\n10,0,,-71\n20,0,-1,-71\n";
    assert_eq!(sigmas(column, None), [Some(7.0), None, None]);
    assert_eq!(sigmas(column, Some(2.0)), [Some(7.0), Some(2.0), Some(2.0)]);
    // Phones state the radius that holds 68 %, and 0 for one that they do not know.
    let phone = "time,lat,lon,accuracy,rssi\n0,48,16,10,-70\n1,48.001,16,0,-71\n";
    let [Some(stated), Some(unstated)] = sigmas(phone, None)[..] else { panic!("two rows") };
    assert_abs_diff_eq!(stated, 10.0 / (-2.0 * 0.32_f64.ln()).sqrt(), epsilon = 0.01);
    assert_abs_diff_eq!(unstated, GNSS_SIGMA_M, epsilon = 1e-9);
}

/// Levels of a receiver whose places are off by errors of σ `sigma_m`, each a share `kept` of the
/// one before, while it moves by `step_m` from row to row.
fn levels(seed: u64, sigma_m: f64, kept: f64, step_m: f64) -> String {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let target = Vector2::new(120.0, 80.0);
    let mut normal = || -> f64 { rng.sample(StandardNormal) };
    let mut off = Vector2::new(normal(), normal()) * sigma_m;
    let mut table = String::from("time_s,east_m,north_m,rss_dbm\n");
    for row in 0..240_u8 {
        let at = Vector2::new(step_m * f64::from(row), 10.0 * (0.1 * f64::from(row)).sin());
        let at = if step_m > 0.0 { at } else { Vector2::zeros() };
        let fresh = Vector2::new(normal(), normal()) * sigma_m;
        off = off * kept + fresh * (1.0 - kept * kept).sqrt();
        let level = -30.0 - 25.0 * (at - target).norm().log10() + 3.0 * normal();
        let believed = at + off;
        writeln!(table, "{row},{:.2},{:.2},{level:.1}", believed.x, believed.y).expect("a string");
    }
    table
}

fn located(received: &[Reception]) -> Located {
    let registry = Registry::builtin();
    let estimator = registry.suited_to(&received.into()).expect("one suits");
    estimator.locate(&received.into(), &LocateConfig::default()).expect("a place")
}

#[test]
fn errors_of_places_are_no_path() {
    let stands = |table: &str, receiver_sigma_m| {
        let config = ReceptionConfig { receiver_sigma_m, ..ReceptionConfig::default() };
        let located = located(&received(table, &config));
        located.remarks.iter().any(|remark| remark.code == "one-place")
    };
    for seed in 0..6 {
        // White errors of a receiver that nothing is known of, and slow ones within its σ.
        assert!(
            stands(
                &levels(seed, 2.0 + f64::from(u32::try_from(seed).expect("small")), 0.0, 0.0),
                None
            ),
            "{seed}"
        );
        assert!(stands(&levels(seed, 4.0, 0.95, 0.0), Some(4.0)), "{seed}");
        // The receiver moves.
        assert!(!stands(&levels(seed, 4.0, 0.0, 1.0), None), "{seed}");
        assert!(!stands(&levels(seed, 4.0, 0.95, 1.0), Some(4.0)), "{seed}");
    }
}

#[test]
fn bearings_up_to_the_transmitter_are_no_surer_than_the_receiver() {
    let sigma_m = 4.0;
    let config = ReceptionConfig { receiver_sigma_m: Some(sigma_m), ..ReceptionConfig::default() };
    let mut held = 0;
    for seed in 0..20 {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut normal = || -> f64 { rng.sample(StandardNormal) };
        let target = Vector2::new(300.0 + 50.0 * normal(), 200.0 + 50.0 * normal());
        let mut off = Vector2::new(normal(), normal()) * sigma_m;
        let mut table =
            String::from("time_s,east_m,north_m,bearing_deg_compass,bearing_sigma_deg\n");
        for row in 0..60_u8 {
            let share = f64::from(row) / 61.0;
            let bend = Vector2::new(-40.0, 60.0) * (std::f64::consts::PI * share).sin();
            let at = target * share + bend;
            let fresh = Vector2::new(normal(), normal()) * sigma_m;
            off = off * 0.98 + fresh * (1.0_f64 - 0.98 * 0.98).sqrt();
            let believed = at + off;
            let way = target - at;
            let bearing = way.x.atan2(way.y).to_degrees() + 5.0 * normal();
            let bearing = (bearing + 540.0).rem_euclid(360.0) - 180.0;
            writeln!(table, "{row},{:.2},{:.2},{bearing:.1},5", believed.x, believed.y)
                .expect("a string");
        }
        let received = received(&table, &config);
        held += usize::from(located(&received).region_95_holds(&target) == Some(true));
    }
    assert!(held >= 18, "{held} of 20");
}
