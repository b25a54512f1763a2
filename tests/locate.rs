//! The estimators that take all observations at once, through the public `locate`.

use foxhunt::{
    core::{Observation, Pose},
    filters::BatchError,
    locate::{LocateConfig, LocateError, LocateEstimator, Power, locate, locate_estimators},
};
use nalgebra::{Matrix2, Vector2};

const REFERENCE_DBM: f64 = -30.0;
const EXPONENT: f64 = 2.3;

fn config(name: &str) -> LocateConfig {
    LocateConfig::new(LocateEstimator::named(name).expect("it has a name"))
}

/// A level and a bearing, free of error, from 30 m above a place; σ 4 dB and 5°.
fn heard(time: f64, east: f64, north: f64, target: Vector2<f64>) -> Observation<2> {
    let way = target - Vector2::new(east, north);
    let level = REFERENCE_DBM - 10.0 * EXPONENT * way.norm().hypot(30.0).log10();
    let value = Vector2::new(level, way.y.atan2(way.x));
    let noise = Matrix2::from_diagonal(&Vector2::new(16.0, 5.0_f64.to_radians().powi(2)));
    Observation::new(time, Pose::at(east, north, 30.0), value, noise).expect("finite")
}

/// 41 places along 200 m to the East, and as many along 200 m to the North if it turns there.
fn flight(target: Vector2<f64>, turns: bool) -> Vec<Observation<2>> {
    let along = |i: i32| 5.0 * f64::from(i);
    let mut flight: Vec<_> = (0..=40).map(|i| heard(f64::from(i), along(i), 0.0, target)).collect();
    if turns {
        flight.extend((1..=40).map(|i| heard(f64::from(40 + i), 200.0, along(i), target)));
    }
    flight
}

fn levels(flight: &[Observation<2>]) -> Vec<Observation<2>> {
    flight.iter().map(|o| o.without(1)).collect()
}

fn bearings(flight: &[Observation<2>]) -> Vec<Observation<2>> {
    flight.iter().map(|o| o.without(0)).collect()
}

/// Levels along a line are the same from either side of it: the mirrored place is told as well,
/// and is exactly as probable. A turn, or bearings, tell the sides apart.
#[test]
fn a_straight_flight_has_a_rival_and_a_bent_one_has_none() {
    let target = Vector2::new(120.0, 60.0);
    let mirrored = Vector2::new(120.0, -60.0);
    let known = Power::Known { reference_dbm: REFERENCE_DBM, exponent: EXPONENT };
    for power in [known, Power::Free] {
        let config = LocateConfig { power, margin_m: 100.0, ..config("batch") };
        let located = locate(&levels(&flight(target, false)), &config).expect("it is solved");
        let off = |place: &Vector2<f64>| (place - target).norm().min((place - mirrored).norm());
        let best = located.estimate.mean;
        assert!(off(&best) < 5.0, "{power:?}: {best}");
        assert_eq!(located.rivals.len(), 1, "{power:?}: {:?}", located.rivals);
        let rival = &located.rivals[0];
        assert!((rival.place - Vector2::new(best.x, -best.y)).norm() < 0.1, "{rival:?}");
        assert!((rival.relative_density - 1.0).abs() < 1e-3, "{rival:?}");
        assert_eq!((located.observations, located.rejected), (41, 0));

        for told in [levels(&flight(target, true)), flight(target, false)] {
            let located = locate(&told, &config).expect("it is solved");
            let error = (located.estimate.mean - target).norm();
            assert!(error < 5.0 && located.rivals.is_empty(), "{power:?}: {error}, {located:?}");
        }
    }
}

/// 20 dB off the truth, a known power leads astray: it is used, and not found anew.
#[test]
fn a_known_power_is_taken_at_its_word() {
    let target = Vector2::new(120.0, 60.0);
    let told = levels(&flight(target, true));
    let error = |power| {
        let config = LocateConfig { power, margin_m: 100.0, ..config("batch") };
        (locate(&told, &config).expect("it is solved").estimate.mean - target).norm()
    };
    let known =
        |off| error(Power::Known { reference_dbm: REFERENCE_DBM + off, exponent: EXPONENT });
    assert!(known(0.0) < 2.0, "{}", known(0.0));
    assert!(known(20.0) > 20.0, "{}", known(20.0));
    assert!(error(Power::Free) < 5.0, "{}", error(Power::Free));
}

/// One level in ten, all of them in one stretch of the flight, is 40 dB too high; the loss bears
/// it.
#[test]
fn a_tenth_of_gross_errors_is_borne() {
    let target = Vector2::new(120.0, 60.0);
    let told: Vec<_> = levels(&flight(target, true))
        .into_iter()
        .enumerate()
        .map(|(i, o)| {
            let value = if (50..58).contains(&i) { o.value().add_scalar(40.0) } else { *o.value() };
            Observation::new(o.time(), *o.receiver(), value, Matrix2::identity() * 16.0)
                .expect("finite")
                .without(1)
        })
        .collect();
    let config = LocateConfig { margin_m: 100.0, ..config("batch") };
    let located = locate(&told, &config).expect("it is solved");
    let error = (located.estimate.mean - target).norm();
    assert!(error < 10.0, "{error}");
}

/// Levels that are off by 4 dB to either side where their σ is said to be 1 dB: the ellipse is
/// about that of a σ which is told as it is.
#[test]
fn errors_beyond_their_sigma_widen_the_ellipse() {
    let told = |sigma_db: f64| -> Vec<_> {
        levels(&flight(Vector2::new(120.0, 60.0), true))
            .iter()
            .zip([4.0, -4.0].into_iter().cycle())
            .map(|(o, off_db)| {
                let value = o.value().add_scalar(off_db);
                let noise = Matrix2::identity() * sigma_db * sigma_db;
                Observation::new(o.time(), *o.receiver(), value, noise).expect("finite").without(1)
            })
            .collect()
    };
    let config = LocateConfig { margin_m: 100.0, ..config("batch") };
    let axis = |sigma_db| {
        let located = locate(&told(sigma_db), &config).expect("it is solved");
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
        let refused = |told: &[Observation<2>]| locate(told, &config(name)).expect_err(name);
        let none = refused(&levels(&flown));
        assert_eq!(none, LocateError::NoBearings { estimator: name });
        let few = refused(&bearings(&flown[..2]));
        let too_few = BatchError::TooFew { what: "bearings", have: 2, need: 3 };
        assert_eq!(few, LocateError::Bearings { estimator: name, source: too_few });
        assert!(few.to_string().contains("batch"), "{few}");
        // All of them to the North.
        let parallel: Vec<_> = (0..5)
            .map(|i| heard(0.0, f64::from(i), 0.0, Vector2::new(f64::from(i), 100.0)).without(0))
            .collect();
        let source = match refused(&parallel) {
            LocateError::Bearings { source, .. } => source,
            other => panic!("{other}"),
        };
        assert!(matches!(source, BatchError::Flat { .. } | BatchError::RanAway { .. }), "{source}");
        // The levels beside them change nothing.
        let both = locate(&flown, &config(name)).expect("they meet");
        assert_eq!(both, locate(&bearings(&flown), &config(name)).expect("they meet"));
        assert!((both.estimate.mean - target).norm() < 1e-3, "{both:?}");
    }
}

/// Lines of flight to the East, 40 m apart, over a transmitter.
fn survey(target: Vector2<f64>) -> Vec<Observation<2>> {
    let lines = (0..6).flat_map(|line| (0..13).map(move |i| (line, i)));
    let observed = lines.map(|(line, i)| {
        let i = if line % 2 == 0 { i } else { 12 - i };
        heard(f64::from(13 * line + i), 20.0 * f64::from(i), 40.0 * f64::from(line), target)
    });
    levels(&observed.collect::<Vec<_>>())
}

#[test]
fn the_field_is_highest_over_the_transmitter() {
    let target = Vector2::new(130.0, 90.0);
    let told = survey(target);
    let config = |seed| LocateConfig { margin_m: 20.0, seed, ..config("field-map") };
    let located = locate(&told, &config(1)).expect("it is mapped");
    let error = (located.estimate.mean - target).norm();
    // A cell is 10 m wide, a line 40 m from the next.
    assert!(error < 15.0, "{error}");
    let nees = located.estimate.nees(&target).expect("positive definite");
    assert!(nees < 13.8, "{nees}");
    assert!(located.border_mass.is_some_and(|mass| mass < 0.05), "{located:?}");
    assert_eq!(located.observations, told.len());
    assert_eq!(locate(&told, &config(1)), Ok(located.clone()));
    assert_ne!(locate(&told, &config(2)), Ok(located));
    let none = locate(&bearings(&flight(target, true)), &config(1));
    assert_eq!(none, Err(LocateError::NoLevels { estimator: "field-map" }));
}

#[test]
fn every_name_leads_to_its_estimator() {
    for known in locate_estimators() {
        assert_eq!(LocateEstimator::named(known.estimator.name()), Some(known.estimator));
        assert!(!known.about.is_empty() && !known.source.is_empty());
    }
    assert!(matches!(LocateEstimator::named("ukf"), Some(LocateEstimator::Recursive(_))));
    assert_eq!(LocateEstimator::named("no-such"), None);
}
