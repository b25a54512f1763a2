//! Levels at the floor of a receiver, and levels that fade alike along a flight: what it takes to
//! call them silences, and fewer than they are.

use std::sync::LazyLock;

use approx::assert_abs_diff_eq;
use foxhunt_core::{Bearing, Level, Pose, Reception};
use foxhunt_filters::{
    Censoring, PlacePrior, ShadowedReading, ShadowingGrid, ShadowingGridConfig, Slope,
};
use foxhunt_hunt::{
    locate::{LocateConfig, LocateError, Located, Power},
    registry::Registry,
};
use nalgebra::{DMatrix, DVector, Vector2};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

const REFERENCE_DBM: f64 = -30.0;
const EXPONENT: f64 = 2.5;
const FLOOR_DBM: f64 = -83.0;
const KNOWN: Power = Power::Known { reference_dbm: REFERENCE_DBM, exponent: EXPONENT };

/// Places of a flight of four legs, 100 m apart and 40 m up, one every 10 m.
static PLACES: LazyLock<Vec<Pose>> = LazyLock::new(|| {
    let mut places = Vec::new();
    for leg in 0..4_u8 {
        for step in 0..=30_u8 {
            let along = 10.0 * f64::from(if leg % 2 == 0 { step } else { 30 - step });
            places.push(Pose::at(along, 100.0 * f64::from(leg), 40.0));
        }
    }
    places
});

/// Factor of the levels' covariance there: shadowing of 6 dB that falls to 1/e over 40 m, and 2 dB
/// of each level's own.
static FACTOR: LazyLock<DMatrix<f64>> = LazyLock::new(|| {
    let n = PLACES.len();
    let covariance = DMatrix::from_fn(n, n, |i, j| {
        let apart_m = (PLACES[i].position - PLACES[j].position).norm();
        36.0 * (-apart_m / 40.0).exp() + if i == j { 4.0 } else { 0.0 }
    });
    covariance.cholesky().expect("positive definite").unpack()
});

/// A flight with a level at each place. The target is drawn from the area.
fn flight(seed: u64) -> (Vector2<f64>, Vec<(Pose, f64)>) {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let target = Vector2::new(300.0 * rng.random::<f64>(), 300.0 * rng.random::<f64>());
    let white = DVector::from_fn(PLACES.len(), |_, _| rng.sample::<f64, _>(StandardNormal));
    let shadowing = &*FACTOR * white;
    let level = |(pose, shadow): (&Pose, &f64)| {
        let range = (target.push(0.0) - pose.position).norm();
        (*pose, REFERENCE_DBM - 10.0 * EXPONENT * range.log10() + shadow)
    };
    (target, PLACES.iter().zip(&shadowing).map(level).collect())
}

/// Treatment of levels below the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Below {
    /// They are received as if there were no floor.
    Received,
    /// The floor is taken for them.
    Floor,
    /// They are left out.
    LeftOut,
    /// They are silences.
    Silent,
}

fn receptions(levels: &[(Pose, f64)], below: Below) -> Vec<Reception> {
    let mut received = Vec::new();
    for (index, (receiver, dbm)) in (0_u16..).zip(levels) {
        let with_sigma = |rss_dbm| Some(Level { rss_dbm, sigma_db: 6.0 });
        let bare =
            Reception { time: f64::from(index), receiver: *receiver, ..Reception::default() };
        received.extend(match below {
            Below::Received => Some(Reception { level: with_sigma(*dbm), ..bare }),
            _ if *dbm > FLOOR_DBM => Some(Reception { level: with_sigma(*dbm), ..bare }),
            Below::Floor => Some(Reception { level: with_sigma(FLOOR_DBM), ..bare }),
            Below::LeftOut => None,
            Below::Silent => Some(Reception { silence: with_sigma(FLOOR_DBM), ..bare }),
        });
    }
    received
}

fn locate(received: &[Reception], estimator: &str, power: Power) -> Result<Located, LocateError> {
    let registry = Registry::builtin();
    let config = LocateConfig { power, ..LocateConfig::default() };
    registry.estimator(estimator).expect("it has a name").locate(&received.into(), &config)
}

/// The results of some flights.
#[derive(Clone, Copy, Debug)]
struct Outcome {
    median_m: f64,
    /// The share of 95 % ellipses that hold the target, of flights with a place.
    covered: f64,
    mean_nees: f64,
    failed: usize,
}

fn judge(estimator: &str, power: Power, below: Below, flights: u64) -> Outcome {
    summary((0..flights).map(|seed| {
        let (target, levels) = flight(seed);
        let located = locate(&receptions(&levels, below), estimator, power);
        located.ok().map(|located| (target, located))
    }))
}

/// The results of flights with these targets and answers.
fn summary(outcomes: impl Iterator<Item = Option<(Vector2<f64>, Located)>>) -> Outcome {
    let mut errors = Vec::new();
    let mut covered = 0.0;
    let mut nees = 0.0;
    let mut failed = 0;
    for outcome in outcomes {
        match outcome {
            None => failed += 1,
            Some((target, located)) => {
                errors.push((located.estimate.mean - target).norm());
                nees += located.estimate.nees(&target).unwrap_or(f64::INFINITY);
                let holds = located.ellipse_95_holds(&target);
                covered += if holds == Some(true) { 1.0 } else { 0.0 };
            }
        }
    }
    errors.sort_by(f64::total_cmp);
    let count = f64::from(u32::try_from(errors.len()).expect("a few"));
    let median_m = errors.get(errors.len() / 2).copied().unwrap_or(f64::INFINITY);
    Outcome { median_m, covered: covered / count, mean_nees: nees / count, failed }
}

/// Outcome of the default estimator of levels, on coarse cells and with its other explanations left
/// out, so that it is quick.
fn judge_grid(below: Below, flights: u64) -> Outcome {
    let config = ShadowingGridConfig {
        gain: Slope::Known(0.0),
        correlation_lengths_m: vec![20.0, 40.0, 80.0],
        nuggets: vec![0.1],
        max_cells: 900,
        place: PlacePrior::NearReceivers { far_share: 0.0, reach: 1.0 },
        ..ShadowingGridConfig::default()
    };
    let grid = ShadowingGrid::new(config).expect("proper");
    let outcomes = (0..flights).map(|seed| {
        let (target, levels) = flight(seed);
        let reading = |r: Reception| {
            let level = r.level.or(r.silence).expect("one of both");
            ShadowedReading {
                receiver: r.receiver,
                value: level.rss_dbm,
                censoring: if r.level.is_none() { Censoring::Below } else { Censoring::None },
            }
        };
        let readings: Vec<_> = receptions(&levels, below).into_iter().map(reading).collect();
        let fix = grid.locate(&readings, |cell: &Vector2<f64>, receiver: &Pose| {
            [-10.0 * (cell.push(0.0) - receiver.position).norm().log10(), 0.0]
        });
        let map = fix.ok()?.finest().clone();
        Some((target, Located::at(map.about(map.median()))))
    });
    summary(outcomes)
}

/// Twenty flights of seeds 0 to 19; the errors of a method differ by a factor of up to ten among
/// them, so that medians are compared with a wide gap, and 95 % ellipses hold 16 at least but for
/// once in 380 such tests.
const FLIGHTS: u64 = 20;

#[test]
fn silences_bring_places_nearer_than_a_floor_taken_for_levels() {
    for (estimator, power) in
        [("least-absolute", Power::Free), ("multilateration", KNOWN), ("batch-multistart", KNOWN)]
    {
        let [floor, silent] =
            [Below::Floor, Below::Silent].map(|below| judge(estimator, power, below, FLIGHTS));
        assert!(silent.failed == 0, "{estimator}: {silent:?}");
        assert!(silent.median_m < 0.8 * floor.median_m, "{estimator}: {floor:?} {silent:?}");
        if estimator == "batch-multistart" {
            assert!(silent.covered >= 0.8 && silent.covered > floor.covered, "{silent:?}");
        }
    }
    let [floor, left_out, silent] =
        [Below::Floor, Below::LeftOut, Below::Silent].map(|below| judge_grid(below, FLIGHTS));
    // A floor taken for levels makes it sure of the wrong place; left out, levels make it unsure.
    assert!(silent.mean_nees < 0.7 * floor.mean_nees, "{floor:?} {silent:?}");
    assert!(silent.median_m < 0.9 * left_out.median_m, "{left_out:?} {silent:?}");
    assert!(silent.covered >= 0.8 && silent.failed == 0, "{silent:?}");
}

#[test]
fn the_strongest_level_knows_of_silences_how_large_a_tenth_is() {
    let [received, silent, left_out] = [Below::Received, Below::Silent, Below::LeftOut]
        .map(|below| judge("strongest", Power::Free, below, FLIGHTS));
    assert_abs_diff_eq!(received.median_m, silent.median_m, epsilon = 1e-9);
    assert!(silent.covered >= 0.8 && left_out.covered < silent.covered, "{silent:?} {left_out:?}");
}

#[test]
fn levels_that_fade_alike_count_for_fewer() {
    // Of 20 mean NEES of two degrees each the χ² bound that holds 99.5 % is 3.34.
    for power in [Power::Free, KNOWN] {
        let outcome = judge("batch-multistart", power, Below::Received, FLIGHTS);
        assert!(outcome.mean_nees < 3.34 && outcome.covered >= 0.8, "{power:?}: {outcome:?}");
        // Not by ellipses that hold everything, either.
        assert!(outcome.mean_nees > 0.5, "{power:?}: {outcome:?}");
    }
}

#[test]
fn levels_from_one_place_leave_the_place_open() {
    let receiver = Pose::at(10.0, 20.0, 8.0);
    let reception = |time: u8| Reception {
        time: f64::from(time),
        receiver,
        level: Some(Level { rss_dbm: -70.0 - f64::from(time % 3), sigma_db: 6.0 }),
        ..Reception::default()
    };
    let levels: Vec<Reception> = (0..20).map(reception).collect();
    let bearing = Bearing { angle: 0.5, sigma: 0.1, confidence: 1.0 };
    let with_bearings: Vec<_> =
        levels.iter().map(|r| Reception { bearing: Some(bearing), ..*r }).collect();
    for estimator in ["batch-multistart", "least-absolute", "shadowing-grid"] {
        let error = locate(&levels, estimator, KNOWN).expect_err(estimator).to_string();
        for part in ["levels", "(10, 20) m", "one place"] {
            assert!(error.contains(part), "{estimator}: {error}");
        }
        assert!(!error.contains("segment") && !error.contains("path"), "{estimator}: {error}");
    }
    let error = locate(&with_bearings, "batch-multistart", Power::Free).expect_err("open");
    assert!(matches!(error, LocateError::Named { .. }) && error.to_string().contains("bearings"));
    // A range by a known power and a bearing meet.
    let located = locate(&with_bearings, "batch-multistart", KNOWN).expect("a place");
    let range = 10.0_f64.powf((70.95 + REFERENCE_DBM) / (10.0 * EXPONENT));
    let expected = Vector2::new(10.0, 20.0) + range * Vector2::new(0.5_f64.cos(), 0.5_f64.sin());
    assert!((located.estimate.mean - expected).norm() < 5.0, "{located:?} {expected}");
}
