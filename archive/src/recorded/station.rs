use std::collections::BTreeMap;

use foxhunt_core::{BeaconId, BearingExtractor, angle};
use foxhunt_sensors::{
    BearingError, CalibrationError, SigmaFit, StationBurst, StationFit, StationModel,
    StationRecord, fit_sigma, fit_stations,
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

/// Stations that were fitted together.
#[derive(Debug)]
pub struct StationsCalibration {
    /// Common pattern of the stations, for stations that were not fitted.
    pub model: StationModel,
    /// Each station in the order given, or why it had no part in the fit.
    pub stations: Vec<Result<StationCalibration, RecordedError>>,
}

/// A station's antennas, fitted to recordings, and the errors of their bearings in
/// cross-validation.
#[derive(Clone, Debug, PartialEq)]
pub struct StationCalibration {
    /// The fit.
    pub fit: StationFit,
    /// Number of days, or other groups, of the bursts.
    pub groups: usize,
    /// The bearings of each day by the pattern fitted to the others; `None` where there are too few
    /// of them.
    pub cross_validation: Option<CrossValidation>,
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
/// turned, or has no boresight.
#[must_use]
pub fn station_boresights<'a>(
    recordings: impl IntoIterator<Item = &'a Recording>,
) -> Option<Vec<f64>> {
    let mut distinct: Vec<f64> = Vec::new();
    for boresight in recordings.into_iter().flat_map(Recording::records).filter_map(|r| r.boresight)
    {
        if distinct.iter().all(|known| angle::distance(*known, boresight) > 1e-6) {
            distinct.push(boresight);
        }
        if distinct.len() > MOST_ANTENNAS {
            return None;
        }
    }
    distinct.sort_by(f64::total_cmp);
    (!distinct.is_empty()).then_some(distinct)
}

/// Fits the boresights and the coarse patterns of stations of fixed antennas together, to
/// recordings of a transmitter whose place is known, and judges each by leaving out one day after
/// the other.
///
/// # Errors
///
/// [`RecordedError`] states why nothing can be fitted. A station whose recordings are not of fixed
/// antennas, or whose place is not known in some line, is left out with its own error.
pub fn fit_boresights(
    stations: &[&[Recording]],
    beacon: Option<&str>,
    config: &StationConfig,
) -> Result<StationsCalibration, RecordedError> {
    let mut gathered: Vec<Result<Gathered<'_>, RecordedError>> =
        stations.iter().map(|own| Gathered::of(own, beacon, config)).collect();
    let records: Vec<StationRecord> =
        gathered.iter_mut().flatten().filter_map(|own| own.record.take()).collect();
    if records.is_empty()
        && let Some(Err(why)) = gathered.pop()
    {
        return Err(why);
    }
    let file = || stations.iter().flat_map(|own| own.iter()).next().map_or("", Recording::file);
    let wrong = |source| RecordedError::Calibration { file: file().to_owned(), source };
    let fitted = fit_stations(&records).map_err(wrong)?;
    let mut fits = fitted.stations.into_iter();
    let judged = |own: Result<Gathered<'_>, RecordedError>| {
        let own = own?;
        let too_few = CalibrationError::TooFew { points: 0, needed: 1 };
        let fit = fits.next().ok_or_else(|| wrong(too_few))?;
        own.judged(fit)
    };
    Ok(StationsCalibration {
        model: fitted.model,
        stations: gathered.into_iter().map(judged).collect(),
    })
}

/// Bursts of a station, with the direction in which the transmitter truly was.
struct Gathered<'a> {
    file: &'a str,
    sweeps: Vec<(RecordedSweep, f64)>,
    record: Option<StationRecord>,
}

impl<'a> Gathered<'a> {
    fn of(
        recordings: &'a [Recording],
        beacon: Option<&str>,
        config: &StationConfig,
    ) -> Result<Self, RecordedError> {
        let file = recordings.first().map_or("", Recording::file);
        let none = || RecordedError::NoStation { file: file.to_owned() };
        let recorded = station_boresights(recordings).ok_or_else(none)?;
        let mut bursts = Vec::new();
        let mut sweeps = Vec::new();
        for recording in recordings {
            for (sweep, truth) in located(recording, beacon, config)? {
                bursts.push(burst(&sweep, truth, &recorded));
                sweeps.push((sweep, truth));
            }
        }
        let record = Some(StationRecord { recorded, bursts });
        Ok(Self { file, sweeps, record })
    }

    /// Judges the bearings of each group by the fit to the others.
    fn judged(&self, fit: StationFit) -> Result<StationCalibration, RecordedError> {
        let mut errors = Vec::new();
        let mut refused = 0;
        for ((sweep, truth), group) in self.sweeps.iter().zip(&fit.groups) {
            let Some(pattern) = fit.without.get(*group) else { continue };
            let wrong = |source| {
                let file = self.file.to_owned();
                RecordedError::Turn { file, line: sweep.line, source }
            };
            let reading = pattern.extract(&sweep.as_sweep(BeaconId(0))).map_err(wrong)?;
            match reading.bearing {
                Ok(bearing) => {
                    let error = angle::wrap(bearing.angle - truth);
                    errors.push(BearingError { error, sigma: bearing.sigma });
                }
                Err(_) => refused += 1,
            }
        }
        let mut sizes: Vec<f64> = errors.iter().map(|e| e.error.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let of_sigma = |sigma: SigmaFit| CrossValidation {
            bearings: errors.len(),
            refused,
            median_error: sizes.get(sizes.len() / 2).copied().unwrap_or_default(),
            coverage_95: sigma.coverage_95,
            sigma,
        };
        let cross_validation = fit_sigma(errors.iter().copied()).ok().map(of_sigma);
        let mut groups = fit.groups.clone();
        groups.sort_unstable();
        groups.dedup();
        Ok(StationCalibration { groups: groups.len(), fit, cross_validation })
    }
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
            located.push((sweep, libm::atan2(way.y, way.x)));
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
