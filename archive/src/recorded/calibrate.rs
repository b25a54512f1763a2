use std::collections::BTreeMap;

use foxhunt_core::BearingExtractor;
use foxhunt_sensors::{CalibrationError, PathLossFit, fit_log_distance};
use nalgebra::Vector2;

use super::{RecordedError, bearings};
use crate::recording::Recording;

/// Settings for fitting a path loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrateConfig {
    /// Place of the transmitter, East and North in metres; the recording's own where absent.
    pub truth: Option<Vector2<f64>>,
    /// Height of the transmitter above the ground of the local frame, in metres.
    pub target_up_m: f64,
    /// The exponent is at most this, if there is a bound.
    pub max_exponent: Option<f64>,
    /// Number of positions in a turn of the antenna.
    pub positions: u16,
}

impl Default for CalibrateConfig {
    /// The recording's own truth, on the ground, no bound, 128 positions.
    fn default() -> Self {
        Self { truth: None, target_up_m: 0.0, max_exponent: None, positions: 128 }
    }
}

/// A fitted path loss, and over which ranges it was fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// The fit.
    pub fit: PathLossFit,
    /// The shortest range, in metres.
    pub nearest_m: f64,
    /// The longest.
    pub farthest_m: f64,
}

/// Fits the log-distance law to recordings whose ranges are known: the mean power of each turn
/// of a directional antenna, as the reference calibrates it (Pritzl 2018, §7.1), or the power of
/// each row of an omnidirectional one. Each recording is read with its own extractor.
///
/// # Errors
///
/// [`RecordedError`] names the file and line where a range is not known, or why the law
/// cannot be fitted.
pub fn calibrate(
    recordings: &[(&Recording, &dyn BearingExtractor)],
    beacon: Option<&str>,
    config: &CalibrateConfig,
) -> Result<Calibration, RecordedError> {
    let mut points = Vec::new();
    for (recording, extractor) in recordings {
        add_points(recording, beacon, *extractor, config, &mut points)?;
    }
    let pairs = points.iter().map(|point| (point.range, point.rss_dbm));
    let fit = fit_log_distance(pairs, config.max_exponent).map_err(|source| {
        let index = match source {
            CalibrationError::Range { index, .. } | CalibrationError::Rss { index, .. } => index,
            _ => usize::MAX,
        };
        match points.get(index) {
            Some(point) => {
                RecordedError::Point { file: point.file.to_owned(), line: point.line, source }
            }
            None => {
                let file = recordings.first().map_or("", |(first, _)| first.file()).to_owned();
                RecordedError::Calibration { file, source }
            }
        }
    })?;
    let nearest_m = points.iter().map(|point| point.range).fold(f64::INFINITY, f64::min);
    let farthest_m = points.iter().map(|point| point.range).fold(0.0, f64::max);
    Ok(Calibration { fit, nearest_m, farthest_m })
}

/// The powers at known ranges that [`calibrate`] fits: metres, and dBm.
///
/// # Errors
///
/// [`RecordedError`] names the file and line where a range is not known.
pub fn known_ranges(
    recordings: &[Recording],
    beacon: Option<&str>,
    extractor: &dyn BearingExtractor,
    config: &CalibrateConfig,
) -> Result<Vec<[f64; 2]>, RecordedError> {
    let mut points = Vec::new();
    for recording in recordings {
        add_points(recording, beacon, extractor, config, &mut points)?;
    }
    Ok(points.iter().map(|point| [point.range, point.rss_dbm]).collect())
}

/// A power at a known range, and the line that it is from.
struct Point<'a> {
    range: f64,
    rss_dbm: f64,
    file: &'a str,
    line: u64,
}

fn add_points<'a>(
    recording: &'a Recording,
    beacon: Option<&str>,
    extractor: &dyn BearingExtractor,
    config: &CalibrateConfig,
    points: &mut Vec<Point<'a>>,
) -> Result<(), RecordedError> {
    let file = recording.file();
    let no_truth = |line| RecordedError::NoTruth { file: file.to_owned(), line };
    let chosen = || recording.records().iter().filter(|r| r.beacon.as_deref() == beacon);
    for record in chosen().filter(|r| r.boresight.is_none()) {
        let Some(rss_dbm) = record.rss_dbm else { continue };
        let truth = config.truth.or(record.truth);
        let to = |t: Vector2<f64>| {
            record.receiver.map(|r| (t.push(config.target_up_m) - r.position).norm())
        };
        let range = record.known_range.or_else(|| truth.and_then(to));
        let range = range.ok_or_else(|| no_truth(record.line))?;
        points.push(Point { range, rss_dbm, file, line: record.line });
    }
    if chosen().any(|r| r.boresight.is_some()) {
        let truths: BTreeMap<u64, Vector2<f64>> =
            chosen().filter_map(|record| Some((record.line, record.truth?))).collect();
        for turn in bearings(recording, extractor, config.positions)? {
            if turn.sweep.beacon_name.as_deref() != beacon {
                continue;
            }
            let line = turn.sweep.line;
            let truth = config.truth.or_else(|| truths.get(&line).copied());
            let truth = truth.filter(|_| turn.sweep.located).ok_or_else(|| no_truth(line))?;
            let way = truth.push(config.target_up_m) - turn.sweep.sweep.receiver.position;
            points.push(Point { range: way.norm(), rss_dbm: turn.reading.rss_dbm, file, line });
        }
    }
    Ok(())
}
