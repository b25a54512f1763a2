//! Levels as people record them, by the default estimator: a long way, a hunt that ends at the
//! transmitter, a receiver at its ceiling, a room. Several of each kind are drawn, and the answers
//! are judged together: their errors beside the place that all readings weighed alike would give,
//! and the share of 95 % regions that hold the transmitter.

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

/// A table being drawn, with its transmitter.
struct Drawn {
    rng: Xoshiro256PlusPlus,
    target: Vector2<f64>,
    p0_dbm: f64,
    exponent: f64,
    sigma_db: f64,
    rows: Vec<(String, Vector2<f64>, f64)>,
}

impl Drawn {
    fn new(seed: u64, extent_m: f64, sigma_db: f64) -> Self {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let side = |u: f64| extent_m * (0.15 + 0.7 * u);
        let target = Vector2::new(side(rng.random()), side(rng.random()));
        let p0_dbm = -45.0 + 20.0 * rng.random::<f64>();
        let exponent = 2.0 + 1.2 * rng.random::<f64>();
        Self { rng, target, p0_dbm, exponent, sigma_db, rows: Vec::new() }
    }

    fn normal(&mut self) -> f64 {
        self.rng.sample(StandardNormal)
    }

    /// A row from a place that the receiver takes for another.
    fn hear(&mut self, drone: &str, at: Vector2<f64>, believed: Vector2<f64>) {
        let range = (at - self.target).norm().max(0.5);
        let noise = self.sigma_db * self.normal();
        let level = self.p0_dbm - 10.0 * self.exponent * range.log10() + noise;
        self.rows.push((drone.to_owned(), believed, level));
    }

    fn locate(&self, receiver_sigma_m: Option<f64>) -> Located {
        let mut table = String::from("time_s,drone,east_m,north_m,rss_dbm\n");
        for (time, (drone, at, level)) in self.rows.iter().enumerate() {
            writeln!(table, "{time},{drone},{:.2},{:.2},{level:.1}", at.x, at.y).expect("a string");
        }
        let options = ReadOptions::default();
        let recording = Recording::from_reader(table.as_bytes(), "drawn.csv", &options);
        let recording = recording.expect("a table of ours");
        let registry = Registry::builtin();
        let config = ReceptionConfig { receiver_sigma_m, ..ReceptionConfig::default() };
        let received =
            receptions(&[recording], None, &Pritzl2018::default(), &config).expect("readable");
        let estimator = registry.suited_to(&received).expect("one suits");
        assert_eq!(&*estimator.name, "shadowing-grid");
        estimator.locate(&received, &LocateConfig::default()).expect("a place")
    }
}

/// The median error in metres, and the number of regions that hold, of answers.
fn judged(answers: impl Iterator<Item = (Vector2<f64>, Located)>) -> (f64, usize) {
    let mut errors = Vec::new();
    let mut held = 0;
    for (target, located) in answers {
        errors.push((located.estimate.mean - target).norm());
        held += usize::from(located.region_95_holds(&target).expect("a region"));
    }
    errors.sort_by(f64::total_cmp);
    (errors[errors.len() / 2], held)
}

#[test]
fn the_longer_the_way_the_nearer_the_answer() {
    // Lanes of a field, 25 m apart, with white noise: 41 rows to a lane.
    let drawn = |seed: u64| {
        let mut drawn = Drawn::new(seed, 1000.0, 4.0);
        for lane in 0..=40_u8 {
            for step in 0..=40_u8 {
                let along = 25.0 * f64::from(if lane % 2 == 0 { step } else { 40 - step });
                let at = Vector2::new(along, 25.0 * f64::from(lane));
                drawn.hear("drone", at, at);
            }
        }
        (drawn.target, drawn.locate(None))
    };
    let (median_m, held) = judged((0..6).map(drawn));
    assert!(median_m < 5.0 && held >= 5, "{median_m} m, {held}");
}

#[test]
fn a_hunt_that_ends_at_the_transmitter_is_as_sure_as_its_receiver() {
    let sigma_m = 4.0;
    let drawn = |seed: u64| {
        let mut drawn = Drawn::new(100 + seed, 600.0, 3.0);
        let mut off = Vector2::new(sigma_m * drawn.normal(), sigma_m * drawn.normal());
        for step in 0..=220_u8 {
            let share = (f64::from(step) / 200.0).min(1.0);
            // The way bends, and ends at the transmitter.
            let bend = Vector2::new(0.0, 120.0 * (std::f64::consts::PI * share).sin());
            let at = drawn.target * share + bend;
            // A satellite receiver's error keeps for minutes.
            let fresh = Vector2::new(drawn.normal(), drawn.normal()) * sigma_m;
            off = off * 0.98 + fresh * (1.0_f64 - 0.98 * 0.98).sqrt();
            drawn.hear("walker", at, at + off);
        }
        (drawn.target, drawn.locate(Some(sigma_m)))
    };
    let (median_m, held) = judged((0..10).map(drawn));
    assert!(median_m < 12.0 && held >= 9, "{median_m} m, {held}");
}

#[test]
fn a_receiver_at_its_ceiling_is_not_believed() {
    // Of 275 rows a seventeenth, a fifth, a third.
    for (clipped, most_m) in [(16, 25.0), (55, 25.0), (96, 60.0)] {
        let drawn = |seed: u64| {
            let mut drawn = Drawn::new(200 + seed, 500.0, 3.0);
            for lane in 0..=10_u8 {
                for step in 0..=24_u8 {
                    let at = Vector2::new(20.0 * f64::from(step), 50.0 * f64::from(lane));
                    drawn.hear("drone", at, at);
                }
            }
            let mut levels: Vec<f64> = drawn.rows.iter().map(|row| row.2).collect();
            levels.sort_by(|a, b| b.total_cmp(a));
            let ceiling = levels[clipped].round();
            drawn.rows.iter_mut().for_each(|row| row.2 = row.2.min(ceiling));
            (drawn.target, drawn.locate(None))
        };
        let (median_m, held) = judged((0..6).map(drawn));
        assert!(median_m < most_m && held >= 5, "{clipped}: {median_m} m, {held}");
    }
}

#[test]
fn a_room_is_as_large_as_it_is() {
    let drawn = |seed: u8| {
        let extent_m = 5.0 + 3.0 * f64::from(seed);
        let mut drawn = Drawn::new(300 + u64::from(seed), extent_m, 2.0);
        for node in 0..6_u8 {
            let place = Vector2::new(f64::from(node % 3) / 2.0, f64::from(node / 3)) * extent_m;
            for _ in 0..20 {
                drawn.hear(&format!("node{node}"), place, place);
            }
        }
        ((drawn.target, drawn.locate(None)), extent_m)
    };
    let all: Vec<_> = (0..8_u8).map(drawn).collect();
    let relative = all
        .iter()
        .map(|((target, located), extent_m)| (located.estimate.mean - target).norm() / extent_m);
    let worst = relative.fold(0.0, f64::max);
    let (_, held) = judged(all.into_iter().map(|(answer, _)| answer));
    assert!(worst < 0.35 && held >= 7, "{worst} of the room, {held}");
}

#[test]
fn a_stated_ceiling_is_the_receivers() {
    let table =
        "east_m,north_m,rss_dbm,ceiling_dbm\n0,0,-60,-40\n9,0,-40,-40\n9,9,-38,-40\n0,9,-70,\n";
    let recording = Recording::from_reader(table.as_bytes(), "stated.csv", &ReadOptions::default());
    let recording = recording.expect("a table of ours");
    let config = ReceptionConfig::default();
    let received = receptions(&[recording], None, &Pritzl2018::default(), &config);
    let limits = received.expect("readable");
    let limits =
        limits.iter().map(|r| (r.level.map(|l| l.rss_dbm), r.saturation.map(|l| l.rss_dbm)));
    let expected =
        [(Some(-60.0), None), (None, Some(-40.0)), (None, Some(-40.0)), (Some(-70.0), None)];
    assert_eq!(limits.collect::<Vec<_>>(), expected);
}
