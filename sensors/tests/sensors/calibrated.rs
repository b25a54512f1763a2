//! A misaligned antenna is found out and corrected.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use core::f64::consts::{PI, TAU};

use foxhunt_core::{
    Bearing, BearingExtractor, BearingMode, BearingModes, NoBearing, NoReading, Pose, Reading,
    Sample, Sweep, angle, laws,
};
use foxhunt_sensors::{
    BearingError, BearingOffset, Calibrated, KnownBearing, OffsetTerms, PatternTable, Pritzl2018,
    fit_bearing_offset, fit_sigma, heading_towards,
};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

use crate::sweeps::{Conditions, simulate, sweep_of};

/// Mounted 8.6° off, with a compass that is off by up to 6.4°.
const OFF: BearingOffset = BearingOffset { constant: 0.15, sin_heading: 0.1, cos_heading: -0.05 };

/// A turn towards a random bearing with a random heading; the antenna looks elsewhere than
/// reported.
fn turn(patch: &PatternTable, rng: &mut Xoshiro256PlusPlus) -> (Vec<Sample>, f64, f64) {
    let (bearing, heading) = (rng.random_range(-PI..PI), rng.random_range(-PI..PI));
    let conditions = Conditions { bearing, heading, ..Conditions::default() };
    let mut samples = simulate(&conditions, patch, rng.random());
    for sample in &mut samples {
        sample.boresight = angle::wrap(sample.boresight + OFF.at(heading));
    }
    (samples, bearing, heading)
}

/// 200 calibrations of 12 turns each by the reference extractor, seed 21: intervals that hold 95 %
/// hold 190 ± 4·√(200·0.95·0.05) = 12.3 of 200, and 2.5 % for their asymptotics.
#[test]
fn a_misaligned_antenna_is_recovered_within_its_interval() {
    let (patch, extractor) = (PatternTable::reference_patch(), Pritzl2018::default());
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(21);
    let mut held = [0_u32; 3];
    for _ in 0..200 {
        let turns = (0..12).map(|_| {
            let (samples, truth, heading) = turn(&patch, &mut rng);
            let reading = extractor.extract(&sweep_of(&samples)).expect("a full turn");
            let measured = reading.bearing.expect("one lobe").angle;
            assert!(
                angle::distance(heading_towards(&sweep_of(&samples), measured), heading) < 1e-9
            );
            KnownBearing { measured, truth, heading }
        });
        let known: Vec<KnownBearing> = turns.collect();
        let fit = fit_bearing_offset(known, OffsetTerms::Heading).expect("a fit");
        let reach = fit.half_intervals(0.95).expect("proper");
        let error = [
            fit.offset.constant - OFF.constant,
            fit.offset.sin_heading - OFF.sin_heading,
            fit.offset.cos_heading - OFF.cos_heading,
        ];
        for (held, (error, reach)) in held.iter_mut().zip(error.iter().zip(&reach)) {
            *held += u32::from(error.abs() <= *reach);
        }
    }
    for held in held {
        assert!(abs_diff_eq!(f64::from(held), 190.0, epsilon = 12.3 + 5.0), "{held} of 200");
    }
}

/// Calibrated on 100 turns, seed 22, the reference extractor is honest on 400 others, seed 23: its
/// rms(error/σ) is 1 ± 4·√(1/(2·400)) = 0.14, and as much again for what 100 turns know.
#[test]
fn a_calibrated_extractor_is_right_and_honest() {
    let (patch, extractor) = (PatternTable::reference_patch(), Pritzl2018::default());
    let errors = |extractor: &dyn BearingExtractor, count: u32, seed: u64| {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let turns = (0..count).map(|_| {
            let (samples, truth, heading) = turn(&patch, &mut rng);
            let reading = extractor.extract(&sweep_of(&samples)).expect("a full turn");
            let bearing = reading.bearing.expect("one lobe");
            (KnownBearing { measured: bearing.angle, truth, heading }, bearing.sigma)
        });
        turns.collect::<Vec<_>>()
    };
    let known = errors(&extractor, 100, 22);
    let points = known.iter().map(|(point, _)| *point);
    let offset = fit_bearing_offset(points, OffsetTerms::Heading).expect("a fit").offset;
    let left = |(point, sigma): &(KnownBearing, f64)| {
        let error = angle::wrap(offset.correct(point.measured, point.heading) - point.truth);
        BearingError { error, sigma: *sigma }
    };
    let sigma = fit_sigma(known.iter().map(left)).expect("a fit");
    // The 2 dB width overstates the error of extraction 4 to 16 times.
    assert!((0.06..0.25).contains(&sigma.rms_ratio), "{sigma:?}");
    let calibrated = Calibrated::new(extractor)
        .with_offset(offset)
        .and_then(|c| c.with_sigma(sigma.scale, sigma.floor))
        .expect("proper");
    let after = errors(&calibrated, 400, 23);
    let rest = |(point, sigma): &(KnownBearing, f64)| BearingError {
        error: angle::wrap(point.measured - point.truth),
        sigma: *sigma,
    };
    let honest = fit_sigma(after.iter().map(rest)).expect("a fit");
    assert_abs_diff_eq!(honest.rms_ratio, 1.0, epsilon = 0.28);
    let again = fit_bearing_offset(after.iter().map(|(p, _)| *p), OffsetTerms::Heading);
    let left = again.expect("a fit").offset;
    // 3.7° over √100, times three terms, four standard errors.
    for value in [left.constant, left.sin_heading, left.cos_heading] {
        assert!(abs_diff_eq!(value, 0.0, epsilon = 0.04), "{left:?}");
    }
}

#[test]
fn a_calibrated_extractor_keeps_the_laws() {
    let patch = PatternTable::reference_patch();
    let calibrated = Calibrated::new(Pritzl2018::default())
        .with_offset(OFF)
        .and_then(|c| c.with_sigma(0.2, 0.02))
        .expect("proper");
    for seed in 0..20 {
        let conditions = Conditions { heading: 0.3, lost: 0.2, ..Conditions::default() };
        let samples = simulate(&conditions, &patch, seed);
        let mut room = samples.clone();
        laws::bearing_extractor(&calibrated, &sweep_of(&samples), &mut room);
    }
    let samples = simulate(&Conditions::default(), &patch, 1);
    let plain = Pritzl2018::default().extract(&sweep_of(&samples)).expect("a full turn");
    assert_eq!(Calibrated::new(Pritzl2018::default()).extract(&sweep_of(&samples)), Ok(plain));
    let ignorant = Calibrated::new(Pritzl2018::default()).with_sigma(0.0, 2.0).expect("proper");
    let reading = ignorant.extract(&sweep_of(&samples)).expect("a level");
    assert!(matches!(reading.bearing, Err(NoBearing::TooWide { .. })), "{reading:?}");
    for (scale, floor) in [(-1.0, 0.0), (0.0, 0.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)] {
        assert!(calibrated.with_sigma(scale, floor).is_err(), "{scale} {floor}");
    }
    let nowhere = BearingOffset { constant: f64::NAN, ..OFF };
    assert!(calibrated.with_offset(nowhere).is_err());
}

/// A body that turns its antenna has another nose for every sample.
#[test]
fn the_heading_is_that_of_the_look() {
    let sample = |i: u16| {
        let heading = TAU * f64::from(i) / 16.0;
        let receiver = Pose { heading, ..Pose::default() };
        Sample { time: 0.0, receiver, boresight: heading + 0.5, position: i, rss_dbm: -60.0 }
    };
    let samples: Vec<Sample> = (0..16).map(sample).collect();
    let sweep = Sweep { positions: 16, ..sweep_of(&samples) };
    assert!(
        angle::distance(heading_towards(&sweep, TAU * 5.0 / 16.0 + 0.5), TAU * 5.0 / 16.0) < 1e-9
    );
    let empty = Sweep { samples: &[], receiver: Pose { heading: 1.5, ..Pose::default() }, ..sweep };
    assert_abs_diff_eq!(heading_towards(&empty, 0.0), 1.5, epsilon = 1e-12);
}

/// Two opposite directions and no bearing, as of an antenna whose back is its front.
struct Opposite;

impl BearingExtractor for Opposite {
    fn extract(&self, _sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        let mode = |weight, angle| BearingMode { weight, angle, sigma: 0.1 };
        let modes = BearingModes::new(&[mode(0.5, 0.3), mode(0.5, 0.3 - PI)]).expect("two");
        Ok(Reading {
            rss_dbm: -60.0,
            rss_sigma_db: 4.0,
            bearing: Err(NoBearing::Ambiguous { resultant: 0.0 }),
            covariance: 0.0,
            modes,
        })
    }
}

#[test]
fn directions_that_compete_are_corrected_each_for_itself() {
    // A body that turned: the nose pointed to where the antenna looked.
    let sample = |heading: f64| Sample {
        time: 0.0,
        receiver: Pose::level(nalgebra::Vector3::zeros(), heading),
        boresight: heading,
        position: 0,
        rss_dbm: -60.0,
    };
    let samples = [sample(0.3), sample(0.3 - PI)];
    let extractor = Calibrated::new(Opposite).with_offset(OFF).expect("finite");
    let extractor = extractor.with_sigma(2.0, 0.0).expect("in range");
    let reading = extractor.extract(&sweep_of(&samples)).expect("it has a level");
    for (mode, heading) in reading.modes.as_slice().iter().zip([0.3, 0.3 - PI]) {
        let error = angle::distance(mode.angle, heading - OFF.at(heading));
        assert!(error < 1e-12 && abs_diff_eq!(mode.sigma, 0.2, epsilon = 1e-12), "{mode:?}");
    }
    assert_eq!(reading.modes.as_slice().len(), 2);
}

/// One direction, and nothing that competes with it.
struct Plain;

impl BearingExtractor for Plain {
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        let bearing = Bearing { angle: 0.3, sigma: 0.1, confidence: 0.9 };
        let modes = BearingModes::default();
        Ok(Reading { bearing: Ok(bearing), modes, ..Opposite.extract(sweep)? })
    }
}

/// Any direction competes, with its share; the bearing stays what it was.
#[test]
fn outliers_point_anywhere() {
    let sweep = Sweep::default();
    let plain = Calibrated::new(Plain).with_outliers(0.02).expect("a share");
    let reading = plain.extract(&sweep).expect("it has a level");
    assert_eq!(reading.bearing, Plain.extract(&sweep).expect("it has a level").bearing);
    let [own, any] = reading.modes.as_slice() else { panic!("{:?}", reading.modes) };
    assert_abs_diff_eq!(own.weight, 0.98, epsilon = 1e-12);
    assert_abs_diff_eq!(own.angle, 0.3, epsilon = 1e-12);
    assert_abs_diff_eq!(any.weight, 0.02, epsilon = 1e-12);
    assert_abs_diff_eq!(any.sigma, PI / 3.0_f64.sqrt(), epsilon = 1e-12);
    let two = Calibrated::new(Opposite).with_outliers(0.5).expect("a share");
    let reading = two.extract(&sweep).expect("it has a level");
    let weights: Vec<f64> = reading.modes.as_slice().iter().map(|mode| mode.weight).collect();
    assert!(weights.iter().zip([0.25, 0.25, 0.5]).all(|(w, want)| (w - want).abs() < 1e-12));
    for probability in [-0.1, 0.6, f64::NAN] {
        assert!(Calibrated::new(Plain).with_outliers(probability).is_err(), "{probability}");
    }
}
