//! A calibration is known as well as its points tell, whoever locates by it.

use foxhunt_core::{Level, Pose, Reception, Receptions};
use foxhunt_hunt::{
    locate::{CalibratedPower, LocateConfig, Power},
    registry::Registry,
};
use foxhunt_sensors::fit_log_distance;
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

const SIGMA_DB: f64 = 8.0;

/// Power of a level at a range, with noise of the surroundings.
fn level(range: f64, [reference_dbm, exponent]: [f64; 2], rng: &mut Xoshiro256PlusPlus) -> f64 {
    let noise: f64 = rng.sample(StandardNormal);
    reference_dbm - 10.0 * exponent * range.log10() + SIGMA_DB * noise
}

/// Twelve points between 50 and 400 m, and the law that they fit.
fn calibration(law: [f64; 2], rng: &mut Xoshiro256PlusPlus) -> CalibratedPower {
    let points: Vec<(f64, f64)> = (0..12)
        .map(|_| {
            let range = 50.0 * 8.0_f64.powf(rng.random());
            (range, level(range, law, rng))
        })
        .collect();
    let fit = fit_log_distance(points, None).expect("ranges differ");
    let c = fit.covariance;
    CalibratedPower {
        reference_dbm: fit.reference_dbm,
        exponent: fit.exponent,
        covariance: [[c.m11, c.m12], [c.m21, c.m22]],
        sigma_db: fit.sigma_db,
        points: fit.points,
    }
}

/// A transmitter beside a flight of 300 m that turns once, 50 to 250 m away from it.
fn flight(law: [f64; 2], rng: &mut Xoshiro256PlusPlus) -> (Vector2<f64>, Vec<Reception>) {
    let target = Vector2::new(rng.random_range(0.0..300.0), rng.random_range(50.0..250.0));
    let reception = |number: u32| {
        let along = 10.0 * f64::from(number % 31);
        let north = if number < 31 { 0.0 } else { -40.0 };
        let receiver = Pose::at(along, north, 30.0);
        let range = (target.push(0.0) - receiver.position).norm();
        let level = Level { rss_dbm: level(range, law, rng), sigma_db: SIGMA_DB };
        let time = f64::from(number);
        Reception { time, receiver, level: Some(level), ..Reception::default() }
    };
    (target, (0..62).map(reception).collect())
}

/// Shares of the 95 % regions that hold the transmitter, with the law's own error and without it.
fn held(estimator: &str, runs: u64) -> [u64; 2] {
    let registry = Registry::builtin();
    let entry = registry.estimator(estimator).expect("it has a name");
    let mut held = [0; 2];
    for seed in 0..runs {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let noise: f64 = rng.sample(StandardNormal);
        let law = [-30.0, 2.3 + 0.5 * noise];
        let calibrated = calibration(law, &mut rng);
        let CalibratedPower { reference_dbm, exponent, .. } = calibrated;
        let (target, receptions) = flight(law, &mut rng);
        let powers = [Power::Calibrated(calibrated), Power::Known { reference_dbm, exponent }];
        for (power, held) in powers.into_iter().zip(&mut held) {
            let config = LocateConfig { power, margin_m: 500.0, ..LocateConfig::default() };
            let Ok(located) = entry.locate(&Receptions::from(&*receptions), &config) else {
                continue;
            };
            *held += u64::from(located.region_95_holds(&target) == Some(true));
        }
    }
    held
}

/// With 95 % of a probability of 95 % at least 53 of 60 and 20 of 24 hold; `multilateration` takes
/// each level for a range, and `least-absolute` levels for Laplace's, so that fewer do.
#[test]
fn the_law_of_a_calibration_is_known_as_well_as_its_points_tell() {
    for (estimator, runs, least) in [
        ("shadowing-grid", 24, 20),
        ("particle", 24, 20),
        ("batch-multistart", 60, 53),
        ("least-absolute", 24, 12),
        ("multilateration", 60, 20),
    ] {
        let [calibrated, known] = held(estimator, runs);
        println!("{estimator}: {calibrated} and {known} of {runs}");
        assert!(calibrated >= least && calibrated > known, "{estimator}: {calibrated}, {known}");
    }
}
