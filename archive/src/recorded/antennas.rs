//! Calibration of antennas: the pattern of one that turns, the deviation of an array that does not.

use foxhunt_core::{BeaconId, Sweep, angle};
use foxhunt_hunt::calibration::ArraySection;
use foxhunt_sensors::{
    BearingError, CalibrationError, DeviationFit, KnownBearing, LearnedPattern, SigmaFit,
    fit_deviation, fit_sigma, learn_pattern,
};
use nalgebra::{Vector2, Vector3};

use super::{CalibrateConfig, RecordedError, only_beacon};
use crate::recording::{Record, RecordedBearing, Recording};

/// Source of a transmitter's true direction, turn by turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KnownDirection {
    /// From the place that the recording has.
    Recorded,
    /// From its place, East and North in metres.
    Place(Vector2<f64>),
    /// It was the same for all turns: radians counter-clockwise from East.
    Bearing(f64),
}

/// Learns an antenna's pattern from all recorded turns of one beacon, with `positions` to a turn.
///
/// # Errors
///
/// [`RecordedError`] names the file and line where the direction is not known, or why nothing can
/// be learned.
pub fn learn_antenna(
    recordings: &[Recording],
    beacon: Option<&str>,
    known: KnownDirection,
    positions: u16,
) -> Result<LearnedPattern, RecordedError> {
    let mut turns = Vec::new();
    let mut bearings = Vec::new();
    for recording in recordings {
        let sweeps = recording.sweeps(positions)?.into_iter();
        for sweep in sweeps.filter(|sweep| sweep.beacon_name.as_deref() == beacon) {
            let from = sweep.located.then(|| sweep.sweep.receiver.position.xy());
            let towards = |place: Vector2<f64>| {
                let way = place - from?;
                (way.norm() > f64::MIN_POSITIVE).then(|| libm::atan2(way.y, way.x))
            };
            let begins = || {
                let mut records = recording.records().iter();
                records.find(|r| r.line == sweep.line && r.beacon.as_deref() == beacon)
            };
            let bearing = match known {
                KnownDirection::Recorded => {
                    begins().and_then(|record| record.truth).and_then(towards)
                }
                KnownDirection::Place(place) => towards(place),
                KnownDirection::Bearing(bearing) => Some(bearing),
            };
            let file = recording.file().to_owned();
            let line = sweep.line;
            bearings.push(bearing.ok_or(RecordedError::NoTruth { file, line })?);
            turns.push(sweep);
        }
    }
    let file = || recordings.iter().map(Recording::file).collect::<Vec<_>>().join(", ");
    if turns.is_empty() {
        return Err(RecordedError::NoTurns { file: file() });
    }
    let turns: Vec<(Sweep<'_>, f64)> =
        turns.iter().map(|sweep| sweep.as_sweep(BeaconId(0))).zip(bearings).collect();
    learn_pattern(&turns).map_err(|source| RecordedError::Antenna { file: file(), source })
}

/// Receivers nearer to each other than this, in metres, are one array at one place: GNSS places a
/// receiver anew in each row.
const ONE_PLACE_M: f64 = 25.0;

/// Headings nearer to each other than this, in radians, are one: 2°.
const ONE_HEADING: f64 = 0.035;

/// Fewest bearings of an array, and fewest for each of its places.
const LEAST_BEARINGS: usize = 6;
const LEAST_AT_A_PLACE: usize = 4;

/// Deviation of an array of antennas that does not turn, from bearings to known transmitters.
#[derive(Clone, Debug, PartialEq)]
pub struct ArrayCalibration {
    /// The fit.
    pub fit: DeviationFit,
    /// Root mean square of the errors before, less their mean, in radians.
    pub rms_before: f64,
    /// The bearings' own σ against their errors without the deviation; `None` if they have none.
    pub sigma: Option<SigmaFit>,
    /// Number of bearings to transmitters without a known place.
    pub unknown: usize,
}

/// Returns true if the recordings of one receiver are ready-made bearings of an array that does not
/// turn: it keeps one heading at each of a few places.
#[must_use]
pub fn is_fixed_array(recordings: &[Recording]) -> bool {
    let mut places: Vec<(Vector3<f64>, f64)> = Vec::new();
    let mut count = 0;
    for record in recordings.iter().flat_map(Recording::records) {
        if record.boresight.is_some() {
            return false;
        }
        let (Some(_), Some(receiver)) = (record.bearing, record.receiver()) else { continue };
        count += 1;
        let near =
            |(place, _): &&(Vector3<f64>, f64)| (place - receiver.position).norm() <= ONE_PLACE_M;
        match places.iter().find(near) {
            Some((_, heading)) if angle::distance(*heading, receiver.heading) > ONE_HEADING => {
                return false;
            }
            Some(_) => {}
            None => places.push((receiver.position, receiver.heading)),
        }
        // A receiver that moves is none, however long its file.
        if places.len() > LEAST_BEARINGS && places.len() * LEAST_AT_A_PLACE > count {
            return false;
        }
    }
    count >= LEAST_BEARINGS && places.len() * LEAST_AT_A_PLACE <= count
}

/// Fits the deviation of an array that does not turn to its bearings of one beacon, or of all
/// beacons whose place the recordings state.
///
/// # Errors
///
/// [`RecordedError`] names the file and line where the true direction to the one beacon is not
/// known. A fit that fails is the inner error.
pub fn calibrate_array(
    recordings: &[Recording],
    beacon: Option<Option<&str>>,
    config: &CalibrateConfig,
) -> Result<Result<ArrayCalibration, CalibrationError>, RecordedError> {
    let mut known = Vec::new();
    let mut sigmas = Vec::new();
    let mut unknown = 0;
    for recording in recordings {
        for record in recording.records() {
            if beacon.is_some_and(|beacon| record.beacon.as_deref() != beacon) {
                continue;
            }
            let Some(bearing) = record.bearing else { continue };
            match towards(record, config.truth) {
                Some((truth, heading)) => {
                    known.push(KnownBearing { measured: bearing.angle, truth, heading });
                    sigmas.push(bearing.sigma);
                }
                None if beacon.is_some() => {
                    let file = recording.file().to_owned();
                    return Err(RecordedError::NoTruth { file, line: record.line });
                }
                None => unknown += 1,
            }
        }
    }
    Ok(fit_deviation(&known).map(|fit| {
        let errors = || known.iter().map(|own| angle::wrap(own.measured - own.truth));
        let sum: Vector2<f64> =
            errors().map(|error| Vector2::new(libm::cos(error), libm::sin(error))).sum();
        let mean = libm::atan2(sum.y, sum.x);
        let count = f64::from(u32::try_from(known.len()).unwrap_or(u32::MAX)).max(1.0);
        let squares: f64 = errors().map(|error| angle::wrap(error - mean).powi(2)).sum();
        let left = known.iter().zip(&sigmas).filter_map(|(own, sigma)| {
            let (angle, _) = fit.deviation.correct(own.measured, own.heading);
            let stretch = fit.deviation.stretch_at(own.measured - own.heading);
            let error = angle::wrap(angle - own.truth) / stretch;
            Some(BearingError { error, sigma: (*sigma)? })
        });
        let sigma = fit_sigma(left).ok();
        ArrayCalibration { rms_before: (squares / count).sqrt(), fit, sigma, unknown }
    }))
}

/// The true direction of a record's transmitter, and the receiver's heading.
fn towards(record: &Record, truth: Option<Vector2<f64>>) -> Option<(f64, f64)> {
    let receiver = record.receiver()?;
    let way = truth.or(record.truth)? - receiver.position.xy();
    (way.norm() > f64::MIN_POSITIVE).then(|| (libm::atan2(way.y, way.x), receiver.heading))
}

/// Takes the deviation off the ready-made bearings of calibrated arrays, whose σ then holds the
/// error of the calibration, too. A receiver is known by its name; the only array of a calibration
/// is that of recordings without names. Returns the number of corrected bearings.
pub fn correct_arrays(recordings: &mut [Recording], arrays: &[ArraySection]) -> usize {
    let proper = arrays.iter().filter(|own| own.check().is_ok());
    let known: Vec<_> = proper.filter_map(|own| Some((own, own.deviation()?))).collect();
    if known.is_empty() {
        return 0;
    }
    let mut corrected = 0;
    for recording in recordings {
        let only = if recording.names_drones() || known.len() > 1 { None } else { known.first() };
        recording.correct_bearings(|record, bearing| {
            let is_own = |section: &ArraySection| {
                section.name.as_deref().is_none_or(|name| *name == *record.drone)
            };
            let own = known.iter().find(|(section, _)| is_own(section)).or(only);
            let (section, deviation) = own.filter(|_| record.boresight.is_none())?;
            let heading = record.receiver().map_or(0.0, |receiver| receiver.heading);
            let (angle, error) = deviation.correct(bearing.angle, heading);
            let stretch = deviation.stretch_at(bearing.angle - heading);
            corrected += 1;
            let sigma = Some(libm::hypot(stretch * section.sigma(bearing.sigma), error));
            Some(RecordedBearing { angle, sigma, is_calibrated: true })
        });
    }
    corrected
}

/// Returns true if the recordings hold several beacons and no beacon was chosen.
#[must_use]
pub fn has_several_beacons(recordings: &[Recording]) -> bool {
    matches!(
        only_beacon(recordings, &super::Selection::Only),
        Err(RecordedError::SeveralBeacons { .. })
    )
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;

    use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
    use rand_distr::StandardNormal;

    use super::*;
    use crate::recording::ReadOptions;

    /// An array's places with its heading there.
    type Places<'a> = &'a [(f64, f64, f64)];

    /// Rows of an array whose bearings are off by three harmonics over the true direction, with a
    /// noise of 1°: a bearing to each transmitter from each place, each transmitter a beacon if
    /// they are `several`.
    fn rows(
        rng: &mut Xoshiro256PlusPlus,
        places: Places<'_>,
        directions: &[f64],
        several: bool,
    ) -> Vec<Recording> {
        let mut text = "beacon,drone,time_s,east_m,north_m,heading_deg_compass,\
                        bearing_deg_compass,truth_east_m,truth_north_m\n"
            .to_owned();
        let mut time = 0;
        for (east, north, heading) in places {
            for (number, direction) in directions.iter().enumerate() {
                let truth: f64 = (heading + direction).to_radians();
                let range = 2000.0 + 500.0 * rng.random::<f64>();
                let [to_east, to_north] = [east + range * truth.sin(), north + range * truth.cos()];
                let off = |k: f64, deg: f64, at: f64| deg * (k * direction.to_radians() + at).sin();
                let noise: f64 = rng.sample(StandardNormal);
                let error = 3.0 + off(1.0, 7.0, 0.4) + off(2.0, 4.0, 1.3) + off(3.0, 2.0, -0.7);
                let bearing = (heading + direction + error + noise).rem_euclid(360.0);
                let beacon = if several { number % 5 } else { 0 };
                writeln!(
                    text,
                    "tag{beacon},mast,{time},{east},{north},{heading},{bearing:.2},{to_east:.1},\
                     {to_north:.1}"
                )
                .expect("a text");
                time += 60;
            }
        }
        let read = Recording::from_reader(text.as_bytes(), "mast.csv", &ReadOptions::default());
        vec![read.expect("rows")]
    }

    /// The root mean square error of corrected bearings in degrees, and the share within 1.96 σ.
    fn judged(recordings: &[Recording]) -> (f64, f64) {
        let mut squares = 0.0;
        let mut held = 0.0;
        let mut count = 0.0;
        for record in recordings.iter().flat_map(Recording::records) {
            let bearing = record.bearing.expect("each row has one");
            let (truth, _) = towards(record, None).expect("each row has a truth");
            let error = angle::wrap(bearing.angle - truth);
            squares += error.to_degrees().powi(2);
            held += f64::from(u8::from(error.abs() <= 1.96 * bearing.sigma.unwrap_or(0.0)));
            count += 1.0;
        }
        ((squares / count).sqrt(), held / count)
    }

    /// Calibrates on some directions, and judges on 720 others: rms and coverage over 40 seeds.
    fn over_seeds(
        places: Places<'_>,
        directions: &[f64],
        several: bool,
        others: impl Fn(f64) -> bool,
    ) -> (f64, f64) {
        const SEEDS: u32 = 40;
        let mut sums = (0.0, 0.0);
        for seed in 0..SEEDS {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(u64::from(seed));
            let own = rows(&mut rng, places, directions, several);
            assert!(is_fixed_array(&own));
            let fitted = calibrate_array(&own, None, &CalibrateConfig::default());
            let fitted = fitted.expect("truths").expect("enough bearings");
            assert!(fitted.fit.deviation.harmonics().len() >= 2, "{fitted:?}");
            let section = ArraySection::new(Some("mast"), &fitted.fit, None);
            let judge: Vec<f64> = (0..720).map(|i| 0.5 * f64::from(i)).collect();
            let judge: Vec<f64> = judge.into_iter().filter(|own| others(*own)).collect();
            let mut others = rows(&mut rng, &[(500.0, 300.0, 77.0)], &judge, false);
            let before = judged(&others).0;
            assert!(before > 4.0, "{before}");
            assert_eq!(correct_arrays(&mut others, &[section]), judge.len());
            let (rms, held) = judged(&others);
            sums.0 += rms / f64::from(SEEDS);
            sums.1 += held / f64::from(SEEDS);
        }
        sums
    }

    fn round(count: u32) -> Vec<f64> {
        (0..count).map(|i| 360.0 * f64::from(i) / f64::from(count)).collect()
    }

    #[test]
    fn an_array_is_calibrated_by_several_beacons() {
        let (rms, held) = over_seeds(&[(0.0, 0.0, 0.0)], &round(30), true, |_| true);
        println!("several beacons: {rms} {held}");
        assert!(rms < 1.3 && (0.9..0.99).contains(&held), "{rms} {held}");
    }

    /// The errors of an array that is mounted backwards are on both sides of 180°.
    #[test]
    fn the_spread_of_errors_across_the_cut_is_theirs() {
        let mut text = "drone,time_s,east_m,north_m,heading_deg_compass,bearing_deg_compass,\
                        truth_east_m,truth_north_m\n"
            .to_owned();
        for step in 0..36_i32 {
            let direction = 10.0 * f64::from(step);
            let bearing = (direction + 180.0 + if step % 2 == 0 { 5.0 } else { -5.0 }) % 360.0;
            let [to_east, to_north] =
                [direction.to_radians().sin(), direction.to_radians().cos()].map(|of| 1000.0 * of);
            writeln!(text, "mast,{step},0,0,0,{bearing},{to_east:.2},{to_north:.2}")
                .expect("a text");
        }
        let read = Recording::from_reader(text.as_bytes(), "mast.csv", &ReadOptions::default());
        let fitted = calibrate_array(&[read.expect("rows")], None, &CalibrateConfig::default());
        let rms = fitted.expect("truths").expect("enough bearings").rms_before;
        assert!((rms.to_degrees() - 5.0).abs() < 0.01, "{}", rms.to_degrees());
    }

    #[test]
    fn gaps_between_directions_are_uncertain() {
        // Nothing from 90° to 150°, and from 250° to 280°.
        let is_gap = |own: f64| (90.0..150.0).contains(&own) || (250.0..280.0).contains(&own);
        let directions: Vec<f64> = round(40).into_iter().filter(|own| !is_gap(*own)).collect();
        let place = [(0.0, 0.0, 30.0)];
        let (rms, held) = over_seeds(&place, &directions, false, |own| !is_gap(own));
        println!("beside gaps: {rms} {held}");
        assert!(rms < 1.35 && (0.9..0.99).contains(&held), "{rms} {held}");
        let (rms, held) = over_seeds(&place, &directions, false, is_gap);
        println!("in gaps: {rms} {held}");
        assert!(rms < 3.0 && held > 0.85, "{rms} {held}");
    }

    #[test]
    fn an_array_is_one_at_several_places() {
        let places = [(0.0, 0.0, 0.0), (800.0, -300.0, 120.0), (-500.0, 900.0, 251.0)];
        let (rms, held) = over_seeds(&places, &round(12), false, |_| true);
        println!("several places: {rms} {held}");
        assert!(rms < 1.3 && (0.9..0.99).contains(&held), "{rms} {held}");
    }

    #[test]
    fn receivers_that_turn_or_move_are_no_arrays() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let turning: Vec<(f64, f64, f64)> = (0..9).map(|i| (0.0, 0.0, f64::from(40 * i))).collect();
        assert!(!is_fixed_array(&rows(&mut rng, &turning, &round(4), false)));
        let moving: Vec<(f64, f64, f64)> =
            (0..30).map(|i| (f64::from(100 * i), 0.0, 0.0)).collect();
        assert!(!is_fixed_array(&rows(&mut rng, &moving, &[10.0], false)));
        assert!(!is_fixed_array(&rows(&mut rng, &[(0.0, 0.0, 0.0)], &round(5), false)));
    }

    #[test]
    fn a_constant_stays_a_constant() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
        let mut taken = 0;
        for _ in 0..100 {
            let known = round(24).into_iter().map(|deg| {
                let noise: f64 = rng.sample(StandardNormal);
                let truth = deg.to_radians();
                KnownBearing { measured: truth + 0.05 + 0.02 * noise, truth, heading: 0.0 }
            });
            let known: Vec<KnownBearing> = known.collect();
            let fit = fit_deviation(&known).expect("enough bearings");
            taken += usize::from(fit.deviation.harmonics().len() > 0);
        }
        println!("harmonics by chance: {taken} of 100");
        assert!(taken <= 5, "{taken}");
    }
}
