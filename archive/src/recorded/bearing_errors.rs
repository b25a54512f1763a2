use std::collections::BTreeMap;

use foxhunt_core::{BeaconId, BearingExtractor, angle};
use foxhunt_hunt::calibration::{BearingCalibration, BearingSection};
use foxhunt_sensors::{
    BearingError, BearingOffsetFit, CalibrationError, KnownBearing, OffsetTerms, SigmaFit,
    fit_bearing_offset, fit_sigma, heading_towards,
};
use nalgebra::{Vector2, Vector3};

use super::{BearingReading, CalibrateConfig, RecordedError, bearings};
use crate::recording::Recording;

/// A bearing out of a recording whose transmitter's place is known.
#[derive(Clone, Copy, Debug, PartialEq)]
struct JudgedBearing {
    /// Measured and true bearing, and heading of the nose.
    known: KnownBearing,
    /// The σ that the bearing had, in radians; `None` where the recording has none.
    sigma: Option<f64>,
}

/// Errors of the bearings of recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct BearingsFit {
    /// Number of bearings.
    pub bearings: usize,
    /// Number of turns without a bearing.
    pub refused: usize,
    /// Constant offset of the bearings, or why it cannot be fitted.
    pub constant: Result<BearingOffsetFit, CalibrationError>,
    /// Offset with its first harmonic over the heading, or why it cannot be fitted.
    pub heading: Result<BearingOffsetFit, CalibrationError>,
    /// σ of the bearings against their errors without the offset, or why it cannot be fitted.
    pub sigma: Result<SigmaFit, CalibrationError>,
}

/// A harmonic that is less probable than this by chance is taken for one.
const HARMONIC_P_VALUE: f64 = 0.01;

impl BearingsFit {
    /// The offset that bearings are corrected by: with the harmonic where that is significant at
    /// 1 %, else the constant.
    #[must_use]
    pub fn offset(&self) -> Option<&BearingOffsetFit> {
        offset(&self.constant, &self.heading)
    }

    /// Returns the section of a calibration; `None` where neither offset nor σ could be fitted.
    #[must_use]
    pub fn section(&self, extractor: &str) -> Option<BearingSection> {
        let offset = self.offset();
        let sigma = self.sigma.as_ref().ok();
        if offset.is_none() && sigma.is_none() {
            return None;
        }
        let mut correction = BearingCalibration::default();
        if let Some(fit) = offset {
            correction.offset_deg_ccw = fit.offset.constant.to_degrees();
            correction.sin_heading_deg = fit.offset.sin_heading.to_degrees();
            correction.cos_heading_deg = fit.offset.cos_heading.to_degrees();
        }
        if let Some(fit) = sigma {
            correction.sigma_scale = fit.scale;
            correction.sigma_floor_deg = fit.floor.to_degrees();
        }
        let half = |half: Vector3<f64>| half.map(f64::to_degrees).into();
        Some(BearingSection {
            extractor: Some(extractor.to_owned()),
            bearings: Some(self.bearings),
            correction,
            half_intervals_deg: offset.and_then(|fit| fit.half_intervals(0.95)).map(half),
            sigma_scale_interval: sigma.map(|fit| fit.scale_interval),
            sigma_floor_interval_deg: sigma.map(|fit| fit.floor_interval.map(f64::to_degrees)),
        })
    }
}

fn offset<'a>(
    constant: &'a Result<BearingOffsetFit, CalibrationError>,
    heading: &'a Result<BearingOffsetFit, CalibrationError>,
) -> Option<&'a BearingOffsetFit> {
    let significant = |fit: &&BearingOffsetFit| {
        fit.harmonic_p_value().is_some_and(|p_value| p_value < HARMONIC_P_VALUE)
    };
    heading.as_ref().ok().filter(significant).or(constant.as_ref().ok())
}

/// Fits the offset of the bearings of recordings with a known transmitter, and how their σ
/// compares with their errors: bearings of turns as the extractor has them, and ready-made ones.
///
/// # Errors
///
/// [`RecordedError`] names the file and line where a true direction is not known, or what cannot be
/// read. A fit that fails is a part of the result.
pub fn calibrate_bearings(
    recordings: &[Recording],
    beacon: Option<&str>,
    extractor: &dyn BearingExtractor,
    config: &CalibrateConfig,
) -> Result<BearingsFit, RecordedError> {
    let mut points = Vec::new();
    let mut refused = 0;
    for recording in recordings {
        refused += known_bearings(recording, beacon, extractor, config, &mut points)?;
    }
    let known = || points.iter().map(|point| point.known);
    let constant = fit_bearing_offset(known(), OffsetTerms::Constant);
    let heading = fit_bearing_offset(known(), OffsetTerms::Heading);
    let taken_off = offset(&constant, &heading).map(|fit| fit.offset).unwrap_or_default();
    let left = points.iter().filter_map(|point| {
        let corrected = taken_off.correct(point.known.measured, point.known.heading);
        let error = angle::wrap(corrected - point.known.truth);
        Some(BearingError { error, sigma: point.sigma? })
    });
    let sigma = fit_sigma(left);
    Ok(BearingsFit { bearings: points.len(), refused, constant, heading, sigma })
}

/// The errors of the bearings that [`calibrate_bearings`] fits, in radians.
///
/// # Errors
///
/// [`RecordedError`] names the file and line where a true direction is not known.
pub fn bearing_errors(
    recordings: &[Recording],
    beacon: Option<&str>,
    extractor: &dyn BearingExtractor,
    config: &CalibrateConfig,
) -> Result<Vec<f64>, RecordedError> {
    let mut points = Vec::new();
    for recording in recordings {
        known_bearings(recording, beacon, extractor, config, &mut points)?;
    }
    let error = |point: &JudgedBearing| angle::wrap(point.known.measured - point.known.truth);
    Ok(points.iter().map(error).collect())
}

/// The direction of `truth` from where a turn was received, in radians counter-clockwise from East;
/// [`None`] where either place is not known, or both are one.
#[must_use]
pub fn true_bearing(turn: &BearingReading, truth: Option<Vector2<f64>>) -> Option<f64> {
    let truth = truth.filter(|_| turn.sweep.located);
    direction(truth, turn.sweep.sweep.receiver.position.xy())
}

fn direction(truth: Option<Vector2<f64>>, from: Vector2<f64>) -> Option<f64> {
    let way = truth? - from;
    (way.norm() > f64::MIN_POSITIVE).then(|| libm::atan2(way.y, way.x))
}

/// Adds a recording's bearings, and returns the number of turns without one.
fn known_bearings(
    recording: &Recording,
    beacon: Option<&str>,
    extractor: &dyn BearingExtractor,
    config: &CalibrateConfig,
    points: &mut Vec<JudgedBearing>,
) -> Result<usize, RecordedError> {
    let no_truth = |line| RecordedError::NoTruth { file: recording.file().to_owned(), line };
    let chosen = || recording.records().iter().filter(|r| r.beacon.as_deref() == beacon);
    for record in chosen() {
        let Some(bearing) = record.bearing else { continue };
        let receiver = record.receiver().ok_or_else(|| no_truth(record.line))?;
        let truth = direction(config.truth.or(record.truth), receiver.position.xy())
            .ok_or_else(|| no_truth(record.line))?;
        let known = KnownBearing { measured: bearing.angle, truth, heading: receiver.heading };
        points.push(JudgedBearing { known, sigma: bearing.sigma });
    }
    let mut refused = 0;
    if chosen().any(|record| record.boresight.is_some()) {
        let truths: BTreeMap<u64, Vector2<f64>> =
            chosen().filter_map(|record| Some((record.line, record.truth?))).collect();
        for turn in bearings(recording, extractor, config.positions)? {
            if turn.sweep.beacon_name.as_deref() != beacon {
                continue;
            }
            let Ok(bearing) = turn.reading.bearing else {
                refused += 1;
                continue;
            };
            let line = turn.sweep.line;
            let truth = config.truth.or_else(|| truths.get(&line).copied());
            let truth = true_bearing(&turn, truth).ok_or_else(|| no_truth(line))?;
            let heading = heading_towards(&turn.sweep.as_sweep(BeaconId(0)), bearing.angle);
            let known = KnownBearing { measured: bearing.angle, truth, heading };
            points.push(JudgedBearing { known, sigma: Some(bearing.sigma) });
        }
    }
    Ok(refused)
}
