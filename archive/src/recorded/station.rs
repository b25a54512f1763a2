use std::collections::BTreeMap;

use foxhunt_core::{BeaconId, BearingExtractor, angle};
use foxhunt_sensors::{
    BearingError, CalibrationError, SigmaFit, StationBurst, StationFit, fit_sigma, fit_station,
};
use nalgebra::Vector2;

use super::RecordedError;
use crate::recording::{RecordedSweep, Recording};

/// Settings for fitting the boresights of a station's antennas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StationConfig {
    /// Number of positions in a turn of the station: at least its number of antennas.
    pub positions: u16,
    /// Bursts from nearer than this are not used, in metres: their direction is that of the errors
    /// of two GNSS receivers.
    pub least_range_m: f64,
    /// Place of the transmitter, East and North in metres; the recordings' own truth where absent.
    pub truth: Option<Vector2<f64>>,
}

impl Default for StationConfig {
    /// 128 positions, bursts from 30 m on, the recordings' own truth.
    fn default() -> Self {
        Self { positions: 128, least_range_m: 30.0, truth: None }
    }
}

/// A station's antennas, fitted to recordings, and the errors of their bearings in
/// cross-validation.
#[derive(Clone, Debug, PartialEq)]
pub struct StationCalibration {
    /// The fit.
    pub fit: StationFit,
    /// Number of days, or other groups, of the bursts.
    pub groups: usize,
    /// The bearings of each day by the pattern fitted to the others.
    pub cross_validation: CrossValidation,
}

/// Errors of bearings that had no part in the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrossValidation {
    /// Number of bearings.
    pub bearings: usize,
    /// Number of bursts without a bearing.
    pub refused: usize,
    /// The median of their absolute errors, in radians.
    pub median_error: f64,
    /// The share of errors within 1.96 σ.
    pub coverage_95: f64,
    /// Comparison of the errors with σ.
    pub sigma: SigmaFit,
}

/// Maximum number of boresights in recordings of a station: more mean an antenna that turns.
const MOST_ANTENNAS: usize = 16;

/// The recorded boresights of a station's fixed antennas, in radians; `None` where the antenna
/// turned, or there is only one.
#[must_use]
pub fn station_boresights(recordings: &[Recording]) -> Option<Vec<f64>> {
    let mut distinct: Vec<f64> = Vec::new();
    for boresight in recordings.iter().flat_map(Recording::records).filter_map(|r| r.boresight) {
        if distinct.iter().all(|known| angle::distance(*known, boresight) > 1e-6) {
            distinct.push(boresight);
        }
        if distinct.len() > MOST_ANTENNAS {
            return None;
        }
    }
    distinct.sort_by(f64::total_cmp);
    (distinct.len() > 1).then_some(distinct)
}

/// Fits the boresights and the coarse pattern of a station's fixed antennas to recordings of a
/// transmitter whose place is known, and judges it by leaving out one day after the other.
///
/// # Errors
///
/// [`RecordedError`] when the recordings are not of fixed antennas, or names the line where a
/// place is not known, or why nothing can be fitted.
pub fn fit_boresights(
    recordings: &[Recording],
    beacon: Option<&str>,
    config: &StationConfig,
) -> Result<StationCalibration, RecordedError> {
    let file = || recordings.first().map_or("", Recording::file).to_owned();
    let none = || RecordedError::NoStation { file: file() };
    let boresights = station_boresights(recordings).ok_or_else(none)?;
    let mut bursts = Vec::new();
    let mut sweeps = Vec::new();
    for recording in recordings {
        for (sweep, truth) in located(recording, beacon, config)? {
            bursts.push(burst(&sweep, truth, &boresights));
            sweeps.push((sweep, truth));
        }
    }
    let wrong = |source: CalibrationError| RecordedError::Calibration { file: file(), source };
    let fit = fit_station(&boresights, &bursts).map_err(wrong)?;
    let mut errors = Vec::new();
    let mut refused = 0;
    for ((sweep, truth), group) in sweeps.iter().zip(&fit.groups) {
        let Some(pattern) = fit.without.get(*group) else { continue };
        let reading = pattern
            .extract(&sweep.as_sweep(BeaconId(0)))
            .map_err(|source| RecordedError::Turn { file: file(), line: sweep.line, source })?;
        match reading.bearing {
            Ok(bearing) => {
                let error = angle::wrap(bearing.angle - truth);
                errors.push(BearingError { error, sigma: bearing.sigma });
            }
            Err(_) => refused += 1,
        }
    }
    let sigma = fit_sigma(errors.iter().copied()).map_err(wrong)?;
    let mut sizes: Vec<f64> = errors.iter().map(|e| e.error.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let cross_validation = CrossValidation {
        bearings: errors.len(),
        refused,
        median_error: sizes.get(sizes.len() / 2).copied().unwrap_or_default(),
        coverage_95: sigma.coverage_95,
        sigma,
    };
    let groups = fit.without.len();
    Ok(StationCalibration { fit, groups, cross_validation })
}

/// The bursts of a recording with the direction in which the transmitter truly was.
fn located(
    recording: &Recording,
    beacon: Option<&str>,
    config: &StationConfig,
) -> Result<Vec<(RecordedSweep, f64)>, RecordedError> {
    let chosen = recording.records().iter().filter(|r| r.beacon.as_deref() == beacon);
    let truths: BTreeMap<u64, Vector2<f64>> =
        chosen.filter_map(|r| Some((r.line, r.truth?))).collect();
    let mut located = Vec::new();
    for sweep in recording.sweeps(config.positions)? {
        if sweep.beacon_name.as_deref() != beacon {
            continue;
        }
        let truth = config.truth.or_else(|| truths.get(&sweep.line).copied());
        let file = recording.file().to_owned();
        let line = sweep.line;
        let truth = truth.filter(|_| sweep.located).ok_or(RecordedError::NoTruth { file, line })?;
        let way = truth - sweep.sweep.receiver.position.xy();
        if way.norm() >= config.least_range_m {
            located.push((sweep, way.y.atan2(way.x)));
        }
    }
    Ok(located)
}

/// A sweep as the fit takes it: one reading for each antenna at most.
fn burst(sweep: &RecordedSweep, truth: f64, boresights: &[f64]) -> StationBurst {
    let reading = |boresight: &f64| {
        let own =
            sweep.sweep.samples.iter().filter(|s| angle::distance(s.boresight, *boresight) < 1e-6);
        let (sum, count) = own.fold((0.0, 0.0), |(sum, n), s| (sum + s.rss_dbm, n + 1.0));
        (count > 0.0).then(|| sum / count)
    };
    // Within a day of seconds; recordings without times are one group.
    #[expect(clippy::cast_possible_truncation, reason = "a day's number is far below 2^53")]
    let group = (sweep.sweep.time / 86_400.0).floor() as i64;
    StationBurst { truth, group, readings_dbm: boresights.iter().map(reading).collect() }
}
