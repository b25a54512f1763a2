use std::collections::BTreeMap;

use foxhunt_core::{BeaconId, BearingExtractor, Observation, ObservationError, Pose, Reception};
use nalgebra::{Matrix2, Vector2, Vector3};

use super::{RecordedError, bearings};
use crate::{
    calibration::BearingCalibration,
    recording::{Record, Recording},
};

/// How certain recorded numbers are taken to be where the recording does not say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObserveConfig {
    /// σ of a received level in dB.
    pub rss_sigma_db: f64,
    /// σ of a ready-made bearing in radians.
    pub bearing_sigma: f64,
    /// How many positions a turn of the antenna has.
    pub positions: u16,
    /// How ready-made bearings err; an extractor has its own.
    pub bearings: BearingCalibration,
    /// σ of the receiver's own East, North and Up in metres; its place is known where absent.
    pub receiver_sigma_m: Option<f64>,
}

impl Default for ObserveConfig {
    /// 8 dB, 10°, 128 positions, bearings as they are, receivers at known places.
    fn default() -> Self {
        let bearing_sigma = 10.0_f64.to_radians();
        Self {
            rss_sigma_db: 8.0,
            bearing_sigma,
            positions: 128,
            bearings: BearingCalibration::default(),
            receiver_sigma_m: None,
        }
    }
}

/// What recordings say of one beacon: level and bearing of each turn of a directional antenna,
/// the level of each row of an omnidirectional one, ready-made bearings. One drone after the
/// other, each in the order of time, so that neighbours lie along one path.
///
/// # Errors
///
/// [`RecordedError`] names the file and the line of what cannot be used.
pub fn observations(
    recordings: &[Recording],
    beacon: Option<&str>,
    extractor: &dyn BearingExtractor,
    config: &ObserveConfig,
) -> Result<Vec<Observation<2>>, RecordedError> {
    let mut observations = Vec::new();
    for recording in recordings {
        let mut of_drone: BTreeMap<&str, Vec<Observation<2>>> = BTreeMap::new();
        let wrong = |line: u64| {
            move |source| RecordedError::Observation {
                file: recording.file().to_owned(),
                line,
                source,
            }
        };
        let mut order = 0.0;
        for record in recording.records() {
            order += 1.0;
            if record.beacon.as_deref() != beacon || record.boresight.is_some() {
                continue;
            }
            let receiver = record.receiver.ok_or_else(|| RecordedError::NoPlace {
                file: recording.file().to_owned(),
                line: record.line,
            })?;
            let time = record.time.unwrap_or(order);
            let one = observe(record, time, receiver, config).map_err(wrong(record.line))?;
            of_drone.entry(&record.drone).or_default().extend(one);
        }
        let turns;
        if recording.records().iter().any(|record| record.boresight.is_some()) {
            turns = bearings(recording, extractor, config.positions)?;
            for turn in &turns {
                if turn.sweep.beacon.as_deref() != beacon {
                    continue;
                }
                if !turn.sweep.located {
                    let (file, line) = (recording.file().to_owned(), turn.sweep.line);
                    return Err(RecordedError::NoPlace { file, line });
                }
                let receiver_sigma_m = config.receiver_sigma_m.map(Vector3::repeat);
                let sweep = turn.sweep.lend(BeaconId(0));
                let reception =
                    Reception { receiver_sigma_m, ..Reception::new(&sweep, &turn.reading) };
                let one = Observation::try_from(&reception).map_err(wrong(turn.sweep.line))?;
                of_drone.entry(&turn.sweep.drone).or_default().push(one);
            }
        }
        for mut path in of_drone.into_values() {
            path.sort_by(|a, b| a.time().total_cmp(&b.time()));
            observations.append(&mut path);
        }
    }
    Ok(observations)
}

/// The observation of one row, if it has a level or a bearing.
fn observe(
    record: &Record,
    time: f64,
    receiver: Pose,
    config: &ObserveConfig,
) -> Result<Option<Observation<2>>, ObservationError> {
    if record.rss_dbm.is_none() && record.bearing.is_none() {
        return Ok(None);
    }
    let calibration = &config.bearings;
    let (angle, sigma) = record.bearing.map_or((0.0, 1.0), |b| {
        let corrected = calibration.offset().correct(b.angle, receiver.heading);
        (corrected, b.sigma.map_or(config.bearing_sigma, |sigma| calibration.sigma(sigma)))
    });
    let value = Vector2::new(record.rss_dbm.unwrap_or(0.0), angle);
    let noise = Vector2::new(config.rss_sigma_db, sigma);
    let noise = Matrix2::from_diagonal(&noise.component_mul(&noise));
    let mut observation = Observation::new(time, receiver, value, noise)?;
    if let Some(sigma) = config.receiver_sigma_m {
        observation = observation.with_receiver_sigma(Vector3::repeat(sigma))?;
    }
    if record.rss_dbm.is_none() {
        observation = observation.without(0);
    }
    if record.bearing.is_none() {
        observation = observation.without(1);
    }
    Ok(Some(observation))
}
