//! The estimators that take all receptions at once, through the public `locate`; receptions of
//! recordings through estimators of both kinds.

use approx::assert_abs_diff_eq;
use std::{collections::BTreeMap, f64::consts::FRAC_PI_2};

use foxhunt_archive::{
    recorded::{ReceptionConfig, receptions},
    recording::{ReadOptions, Recording},
};
use foxhunt_core::{Bearing, Level, Pose, Reception, Receptions};
use foxhunt_filters::BatchError;
use foxhunt_hunt::{
    locate::{LearnedSigma, LocateConfig, LocateError, Located, Power, learn_bearing_sigma},
    registry::Registry,
};
use foxhunt_sensors::{Dipole, ElevationPattern, Pritzl2018};
use nalgebra::{Vector2, Vector3};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use crate::support::shared;

const REFERENCE_DBM: f64 = -30.0;
const EXPONENT: f64 = 2.3;

fn locate(
    receptions: &[Reception],
    estimator: &str,
    config: &LocateConfig,
) -> Result<Located, LocateError> {
    let registry = Registry::builtin();
    let entry = registry.estimator(estimator).expect("it has a name");
    entry.locate(&receptions.into(), config)
}

/// A level and a bearing, free of error, from 30 m above a place; σ 4 dB and 5°.
fn reception(time: f64, east: f64, north: f64, target: Vector2<f64>) -> Reception {
    let way = target - Vector2::new(east, north);
    let rss_dbm = REFERENCE_DBM - 10.0 * EXPONENT * way.norm().hypot(30.0).log10();
    let angle = way.y.atan2(way.x);
    Reception {
        time,
        receiver: Pose::at(east, north, 30.0),
        level: Some(Level { rss_dbm, sigma_db: 4.0 }),
        bearing: Some(Bearing { angle, sigma: 5.0_f64.to_radians(), confidence: 1.0 }),
        ..Reception::default()
    }
}

/// 41 places along 200 m to the East, and as many along 200 m to the North if it turns there.
fn flight(target: Vector2<f64>, turns: bool) -> Vec<Reception> {
    let along = |i: i32| 5.0 * f64::from(i);
    let mut flight: Vec<_> =
        (0..=40).map(|i| reception(f64::from(i), along(i), 0.0, target)).collect();
    if turns {
        flight.extend((1..=40).map(|i| reception(f64::from(40 + i), 200.0, along(i), target)));
    }
    flight
}

fn levels(flight: &[Reception]) -> Vec<Reception> {
    flight.iter().map(|r| Reception { bearing: None, ..*r }).collect()
}

fn bearings(flight: &[Reception]) -> Vec<Reception> {
    flight.iter().map(|r| Reception { level: None, ..*r }).collect()
}

/// The reception with its level off by some decibels, and another σ.
fn off_by(reception: &Reception, off_db: f64, sigma_db: f64) -> Reception {
    let level = reception.level.map(|level| Level { rss_dbm: level.rss_dbm + off_db, sigma_db });
    Reception { level, ..*reception }
}

/// Levels along a line are the same from either side of it: the mirrored place is a rival and
/// exactly as probable. A turn, or bearings, distinguish the sides.
#[test]
fn a_straight_flight_has_a_rival_and_a_bent_one_has_none() {
    let target = Vector2::new(120.0, 60.0);
    let mirrored = Vector2::new(120.0, -60.0);
    let known = Power::Known { reference_dbm: REFERENCE_DBM, exponent: EXPONENT };
    for power in [known, Power::FreeReference { exponent: EXPONENT }, Power::Free] {
        let config = LocateConfig { power, margin_m: 100.0, ..LocateConfig::default() };
        let straight = levels(&flight(target, false));
        let located = locate(&straight, "batch-multistart", &config).expect("it is solved");
        let off = |place: &Vector2<f64>| (place - target).norm().min((place - mirrored).norm());
        let best = located.estimate.mean;
        assert!(off(&best) < 5.0, "{power:?}: {best}");
        assert_eq!(located.rivals.len(), 1, "{power:?}: {:?}", located.rivals);
        let rival = &located.rivals[0];
        assert!((rival.place - Vector2::new(best.x, -best.y)).norm() < 0.1, "{rival:?}");
        assert_abs_diff_eq!(rival.relative_density, 1.0, epsilon = 1e-3);
        assert_eq!((located.observations, located.rejected), (41, 0));

        for distinct in [levels(&flight(target, true)), flight(target, false)] {
            let located = locate(&distinct, "batch-multistart", &config).expect("it is solved");
            let error = (located.estimate.mean - target).norm();
            assert!(error < 5.0 && located.rivals.is_empty(), "{power:?}: {error}, {located:?}");
        }
    }
}

/// A known power that is 20 dB off leads astray: it is used, and not estimated again.
#[test]
fn a_known_power_is_used_and_not_estimated() {
    let target = Vector2::new(120.0, 60.0);
    let bent = levels(&flight(target, true));
    let error = |power| {
        let config = LocateConfig { power, margin_m: 100.0, ..LocateConfig::default() };
        let located = locate(&bent, "batch-multistart", &config).expect("it is solved");
        (located.estimate.mean - target).norm()
    };
    let known =
        |off| error(Power::Known { reference_dbm: REFERENCE_DBM + off, exponent: EXPONENT });
    assert!(known(0.0) < 2.0, "{}", known(0.0));
    assert!(known(20.0) > 20.0, "{}", known(20.0));
    assert!(error(Power::Free) < 5.0, "{}", error(Power::Free));
}

/// An exponent alone leaves the power free: levels that are all off by as much lead to the same
/// place, another exponent to another one.
#[test]
fn an_exponent_can_be_known_without_the_power() {
    let target = Vector2::new(120.0, 60.0);
    let bent = levels(&flight(target, true));
    let louder: Vec<Reception> = bent.iter().map(|r| off_by(r, 33.0, 2.0)).collect();
    for estimator in ["shadowing-grid", "batch-multistart", "grid"] {
        let place = |receptions: &[Reception], exponent| {
            let power = Power::FreeReference { exponent };
            let config = LocateConfig { power, margin_m: 100.0, ..LocateConfig::default() };
            locate(receptions, estimator, &config).expect("it is located").estimate.mean
        };
        let right = place(&bent, EXPONENT);
        assert!((right - target).norm() < 10.0, "{estimator}: {right}");
        // The louder levels have σ 2 dB, too, so that only the power differs.
        let same_sigma: Vec<Reception> = bent.iter().map(|r| off_by(r, 0.0, 2.0)).collect();
        let moved = place(&louder, EXPONENT) - place(&same_sigma, EXPONENT);
        assert!(moved.norm() < 0.1, "{estimator}: {moved}");
        let other = place(&bent, 2.0 * EXPONENT);
        assert!((other - right).norm() > 1.0, "{estimator}: {other}");
    }
}

/// Levels of a transmitter with an upright dipole at one on a drone, on four lanes 40 m above it:
/// whoever takes them for isotropic looks for a place where the levels have no hole. The antennas
/// named, the ellipses hold the truth as often as they should; NEES is 2 on average, and between
/// 1.04 and 3.34 over 20 runs with 99 %.
#[test]
fn named_antennas_explain_the_hole_below_a_drone() {
    const RUNS: u32 = 20;
    let dipole = ElevationPattern::of(&Dipole);
    let named = ElevationPattern::between(&dipole, &dipole);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(5);
    let mut sums = BTreeMap::<(&str, bool), (f64, f64)>::new();
    for _ in 0..RUNS {
        let target = Vector2::from_fn(|_, _| 40.0 + 120.0 * random.random_range(0.0..1.0_f64));
        let receptions: Vec<Reception> = (0..160_u32)
            .map(|i| {
                let lane = f64::from(i / 40);
                let along = 5.0 * f64::from(i % 40);
                let receiver = Pose::at(along, 60.0 * lane, 40.0);
                let way = target.push(0.0) - receiver.position;
                // The dipole's gain at the sine of an elevation e: cos(π/2 sin e)/cos e.
                let sine = way.z / way.norm();
                let cosine = way.xy().norm() / way.norm();
                let gain = 20.0 * ((FRAC_PI_2 * sine).cos() / cosine).log10();
                let noise: f64 = random.sample(StandardNormal);
                let law = REFERENCE_DBM - 10.0 * EXPONENT * way.norm().log10();
                let level = Level { rss_dbm: law + 2.0 * gain + 2.0 * noise, sigma_db: 2.0 };
                Reception { time: i.into(), receiver, level: Some(level), ..Reception::default() }
            })
            .collect();
        let contenders = [("shadowing-grid", true), ("particle", true), ("particle", false)];
        for (estimator, known) in contenders {
            let config = LocateConfig {
                power: Power::FreeReference { exponent: EXPONENT },
                pattern: known.then(|| named.clone()),
                margin_m: 50.0,
                ..LocateConfig::default()
            };
            let fix = locate(&receptions, estimator, &config).expect("it is located");
            let error = fix.estimate.mean - target;
            let solved = fix.estimate.covariance.cholesky().expect("definite").solve(&error);
            let sum = sums.entry((estimator, known)).or_default();
            *sum = (
                sum.0 + error.norm_squared() / f64::from(RUNS),
                sum.1 + error.dot(&solved) / f64::from(RUNS),
            );
        }
    }
    for ((estimator, known), (square, nees)) in sums {
        let rms = square.sqrt();
        let consistent = (1.04..3.34).contains(&nees);
        assert_eq!(consistent, known, "{estimator}, {known}: {rms} m, NEES {nees}");
        assert!(
            rms < if estimator == "particle" { 7.0 } else { 12.0 } || !known,
            "{estimator}: {rms} m"
        );
    }
    let refused = LocateConfig { pattern: Some(named), ..LocateConfig::default() };
    let one = levels(&flight(Vector2::new(120.0, 60.0), true));
    for estimator in ["strongest", "batch-multistart", "particle-bearing"] {
        let error = locate(&one, estimator, &refused).expect_err("it does not use them");
        assert!(matches!(error, LocateError::NoUseOfAntennas { .. }), "{estimator}: {error}");
    }
}

/// A file in UTM metres has its places six hundred and four thousand kilometres from the origin;
/// what is found lies there too, as exactly as about the origin.
#[test]
fn metres_keep_their_origin() {
    let target = Vector2::new(120.0, 60.0);
    let origin = Vector3::new(608_377.25, 4_074_518.75, 0.0);
    let here = flight(target, true);
    let there: Vec<Reception> = here
        .iter()
        .map(|reception| {
            let mut moved = *reception;
            moved.receiver.position += origin;
            moved
        })
        .collect();
    let config = LocateConfig { margin_m: 100.0, ..LocateConfig::default() };
    for (names, pick) in [
        (&["shadowing-grid", "field-map"][..], levels as fn(&[Reception]) -> Vec<Reception>),
        (&["lenth1981", "lenth1981-andrews", "stansfield"], bearings),
        (
            &["batch-multistart", "batch", "grid", "ukf", "particle", "default"],
            <[Reception]>::to_vec,
        ),
    ] {
        for name in names {
            let near = locate(&pick(&here), name, &config).expect("it is located").estimate;
            let far = locate(&pick(&there), name, &config).expect("it is located").estimate;
            let off = (far.mean - near.mean - origin.xy()).norm();
            // A place of 4·10⁶ m is known to 5·10⁻¹⁰ m, and clouds may draw another particle.
            let spread = near.covariance.trace().sqrt();
            assert!(off < 0.05 * spread.max(1.0), "{name}: {off} of {spread}");
        }
    }
}

/// One level in ten, all of them in one stretch of the flight, is 40 dB too high; the loss bears
/// it.
#[test]
fn a_tenth_of_gross_errors_is_borne() {
    let target = Vector2::new(120.0, 60.0);
    let wrong: Vec<_> = levels(&flight(target, true))
        .iter()
        .enumerate()
        .map(|(i, r)| off_by(r, if (50..58).contains(&i) { 40.0 } else { 0.0 }, 4.0))
        .collect();
    let config = LocateConfig { margin_m: 100.0, ..LocateConfig::default() };
    let located = locate(&wrong, "batch-multistart", &config).expect("it is solved");
    let error = (located.estimate.mean - target).norm();
    assert!(error < 10.0, "{error}");
}

/// Levels that are off by 4 dB to either side with a σ of 1 dB: the ellipse is about that of the
/// right σ.
#[test]
fn errors_beyond_their_sigma_widen_the_ellipse() {
    let with_sigma = |sigma_db: f64| -> Vec<_> {
        levels(&flight(Vector2::new(120.0, 60.0), true))
            .iter()
            .zip([4.0, -4.0].into_iter().cycle())
            .map(|(r, off_db)| off_by(r, off_db, sigma_db))
            .collect()
    };
    let config = LocateConfig { margin_m: 100.0, ..LocateConfig::default() };
    let axis = |sigma_db| {
        let located = locate(&with_sigma(sigma_db), "batch-multistart", &config);
        let located = located.expect("it is solved");
        located.estimate.ellipse(0.95).expect("positive definite").semi_major
    };
    let ratio = axis(1.0) / axis(4.0);
    assert!((0.6..1.5).contains(&ratio), "{ratio}");
}

#[test]
fn bearings_that_are_none_or_do_not_meet_are_refused() {
    let target = Vector2::new(120.0, 60.0);
    let flown = flight(target, false);
    for name in ["lenth1981", "lenth1981-huber", "lenth1981-andrews"] {
        let config = LocateConfig::default();
        let refused = |receptions: &[Reception]| {
            let error = locate(receptions, name, &config).expect_err(name);
            assert!(error.to_string().contains(name), "{error}");
            match error {
                LocateError::Named { source, .. } => *source,
                other => panic!("{other}"),
            }
        };
        assert_eq!(refused(&levels(&flown)), LocateError::NoBearings);
        let few = refused(&bearings(&flown[..2]));
        let too_few = BatchError::TooFew { what: "bearings", have: 2, need: 3 };
        assert_eq!(few, LocateError::Bearings(too_few));
        assert!(few.to_string().contains("batch-multistart"), "{few}");
        // All of them to the North.
        let parallel: Vec<_> = (0..5)
            .map(|i| reception(0.0, f64::from(i), 0.0, Vector2::new(f64::from(i), 100.0)))
            .collect();
        let source = match refused(&bearings(&parallel)) {
            LocateError::Bearings(source) => source,
            other => panic!("{other}"),
        };
        assert!(matches!(source, BatchError::Flat { .. } | BatchError::RanAway { .. }), "{source}");
        // The levels beside them change nothing.
        let both = locate(&flown, name, &config).expect("they meet");
        assert_eq!(both, locate(&bearings(&flown), name, &config).expect("they meet"));
        assert!((both.estimate.mean - target).norm() < 1e-3, "{both:?}");
    }
}

/// Lines of flight to the East, 40 m apart, over a transmitter.
fn survey(target: Vector2<f64>) -> Vec<Reception> {
    let lines = (0..6).flat_map(|line| (0..13).map(move |i| (line, i)));
    let observed = lines.map(|(line, i)| {
        let i = if line % 2 == 0 { i } else { 12 - i };
        let east = 20.0 * f64::from(i);
        let north = 40.0 * f64::from(line);
        reception(f64::from(13 * line + i), east, north, target)
    });
    levels(&observed.collect::<Vec<_>>())
}

#[test]
fn the_field_is_highest_over_the_transmitter() {
    let target = Vector2::new(130.0, 90.0);
    let flown = survey(target);
    let map = |seed| {
        let config = LocateConfig { margin_m: 20.0, seed, ..LocateConfig::default() };
        locate(&flown, "field-map", &config)
    };
    let located = map(1).expect("it is mapped");
    let error = (located.estimate.mean - target).norm();
    // A cell is 10 m wide, a line 40 m from the next.
    assert!(error < 15.0, "{error}");
    let nees = located.estimate.nees(&target).expect("positive definite");
    assert!(nees < 13.8, "{nees}");
    assert!(located.border_mass.is_some_and(|mass| mass < 0.05), "{located:?}");
    assert_eq!(located.observations, flown.len());
    assert_eq!(map(1), Ok(located.clone()));
    assert_ne!(map(2), Ok(located));
    let none = locate(&bearings(&flight(target, true)), "field-map", &LocateConfig::default());
    let Err(LocateError::Named { source, .. }) = none else { panic!("{none:?}") };
    assert_eq!(*source, LocateError::NoLevels);
}

/// The bearings alone count: levels may be anything, or missing, and no bit of the place changes.
#[test]
fn levels_make_no_difference_to_estimators_of_bearings() {
    let target = Vector2::new(120.0, 60.0);
    let flown = flight(target, true);
    let config = LocateConfig::default();
    for name in ["particle-bearing", "particle-bearing-moving"] {
        let expected = locate(&flown, name, &config).expect("they are bearings");
        let shifted: Vec<_> =
            flown.iter().zip(0..).map(|(r, i)| off_by(r, f64::from(i), 1.0)).collect();
        for other in [shifted, bearings(&flown)] {
            assert_eq!(locate(&other, name, &config), Ok(expected.clone()), "{name}");
        }
        assert!((expected.estimate.mean - target).norm() < 30.0, "{name}: {expected:?}");
        let both = locate(&flown, "particle", &config).expect("levels and bearings");
        assert_ne!(both.estimate, expected.estimate, "{name} and particle are two estimators");
    }
    let [still, moving] = ["particle-bearing", "particle-bearing-moving"]
        .map(|name| locate(&flown, name, &config).expect("they are bearings").estimate);
    assert_ne!(still, moving);
}

/// Places that the program before version 0.2 found in the same recordings; in the flight's levels
/// `batch-multistart` since then counts what fades alike for fewer. A particle cloud is not among
/// them: its stream of random numbers is another one now.
#[test]
fn recordings_lead_to_the_places_that_they_led_to() {
    let flight = "aerpaw_afar/afar_exp288_loc1_1hz.csv";
    let bearings = "lenth1981/bearings.csv";
    let expected: [(&str, &str, [f64; 5]); 7] = [
        (
            flight,
            "shadowing-grid",
            [
                -77.00433530240802,
                73.3281500400816,
                3760.2980223765344,
                622.4759553781331,
                3625.879904593685,
            ],
        ),
        (
            flight,
            "field-map",
            [
                -87.38612970454336,
                59.863820606851405,
                25426.46962345678,
                7912.63931851852,
                23259.059317530824,
            ],
        ),
        (
            flight,
            "batch-multistart",
            [
                -73.38892896124084,
                59.705165479938216,
                2153.69365068506,
                325.38082123563356,
                2119.848449676251,
            ],
        ),
        (
            bearings,
            "lenth1981",
            [
                5.8706237974412065,
                1.1337122020686317,
                2.2192718814753527,
                1.3134283074945912,
                3.002670922000409,
            ],
        ),
        (
            bearings,
            "lenth1981-huber",
            [
                6.781143172479379,
                1.6609620384503354,
                0.7793908603085721,
                0.5002134217272877,
                0.8919127177800221,
            ],
        ),
        (
            bearings,
            "lenth1981-andrews",
            [
                7.208487469779899,
                1.9665841178841974,
                0.02422670571304376,
                0.016120770196352337,
                0.023951630562797612,
            ],
        ),
        (
            bearings,
            "batch-multistart",
            [
                7.103865415390597,
                1.8893995265636447,
                0.2688165627150777,
                0.167056030553346,
                0.2668346513086197,
            ],
        ),
    ];
    for (file, name, [east, north, var_east, covariance, var_north]) in expected {
        let Some(path) = shared(file) else { return };
        let recording = Recording::read(&path, &ReadOptions::default()).expect("it can be read");
        let received =
            receptions(&[recording], None, &Pritzl2018::default(), &ReceptionConfig::default());
        let received: Vec<_> = received.expect("they are of use").iter().collect();
        let located = locate(&received, name, &LocateConfig::default()).expect("it is located");
        let found = located.estimate;
        let numbers = [found.mean.x, found.mean.y].into_iter();
        let numbers = numbers.chain([(0, 0), (0, 1), (1, 1)].map(|index| found.covariance[index]));
        for (number, golden) in numbers.zip([east, north, var_east, covariance, var_north]) {
            // What is iterated ends where its steps are short.
            let close = (number - golden).abs() <= 1e-6 * golden.abs();
            if !close {
                eprintln!("GOLD {file}, {name}: {found:?}");
            }
        }
    }
}

/// 60 transmitters with four bearings each that are off by 3° where 10° are taken for true: σ is
/// learned to its standard error, 1 in √(2 · 122), times 3.29.
#[test]
fn sigma_of_bearings_is_learned_from_several_transmitters() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(31);
    let receivers = [(0.0, 0.0), (900.0, 100.0), (100.0, 800.0), (800.0, 900.0)];
    let taken = 10.0_f64.to_radians();
    let true_sigma = 3.0_f64.to_radians();
    let transmitters: Vec<Receptions> = (0..60)
        .map(|_| {
            let east = 1000.0 * rng.random::<f64>();
            let north = 1000.0 * rng.random::<f64>();
            let bearing = |&(x, y): &(f64, f64)| {
                let error: f64 = rng.sample(StandardNormal);
                let angle = (north - y).atan2(east - x) + true_sigma * error;
                Reception {
                    receiver: Pose::at(x, y, 0.0),
                    bearing: Some(Bearing { angle, sigma: taken, confidence: 1.0 }),
                    ..Reception::default()
                }
            };
            receivers.iter().map(bearing).collect()
        })
        .collect();
    let config = LocateConfig::default();
    let learned = learn_bearing_sigma(&transmitters, &config);
    let LearnedSigma { factor, freedom, left_out } = learned;
    assert!(left_out.is_empty(), "{left_out:?}");
    assert_abs_diff_eq!(freedom, 122.0, epsilon = 1e-9);
    // The two degrees of freedom of before pull towards 10°, and are a part of the answer.
    let expected = ((2.0 + 120.0 * 0.09) / 122.0_f64).sqrt();
    assert_abs_diff_eq!(factor / expected, 1.0, epsilon = 3.29 / 244.0_f64.sqrt());
}
