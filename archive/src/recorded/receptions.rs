//! Receptions out of recordings: the bearings of turns, levels, and receivers that stay in one
//! place.

use std::{cmp::Ordering, collections::BTreeMap, sync::Arc};

use foxhunt_core::{
    BeaconId, Bearing, BearingExtractor, ByQuantity, Intake, Level, Pose, Quantity, Reading,
    Reception, Receptions,
};
use foxhunt_hunt::{calibration::BearingCalibration, locate::Listener};
use nalgebra::Vector3;

use super::RecordedError;
use crate::recording::{
    Beside, Column, Record, RecordedSweep, Recording, Source, builtin_mappings,
};

/// A bearing whose confidence is below this should not be relied on.
///
/// The confidence is the mean resultant length of the power over the turn, times the share of the
/// circle that was received; of a clean patch antenna it is 0.8, of a flat pattern 0.
pub const LOW_CONFIDENCE: f64 = 0.6;

/// An extractor's result for a recorded turn.
#[derive(Clone, Debug, PartialEq)]
pub struct BearingReading {
    /// The turn.
    pub sweep: RecordedSweep,
    /// Level of the turn, and its bearing or the reason that the bearing is missing.
    pub reading: Reading,
}

impl BearingReading {
    /// Returns true if the turn has a bearing that is not to be relied on.
    #[must_use]
    pub fn is_low(&self) -> bool {
        self.reading.bearing.is_ok_and(|bearing| bearing.confidence < LOW_CONFIDENCE)
    }
}

/// Extracts the level and bearing of every turn of a recording, of `positions` positions each.
///
/// # Errors
///
/// [`RecordedError`] when there is no turn, or one cannot be read.
pub fn bearings(
    recording: &Recording,
    extractor: &dyn BearingExtractor,
    positions: u16,
) -> Result<Vec<BearingReading>, RecordedError> {
    let sweeps = recording.sweeps(positions)?;
    if sweeps.is_empty() {
        return Err(RecordedError::NoTurns { file: recording.file().to_owned() });
    }
    sweeps
        .into_iter()
        .map(|sweep| {
            let reading = extractor.extract(&sweep.as_sweep(BeaconId(0))).map_err(|source| {
                RecordedError::Turn { file: recording.file().to_owned(), line: sweep.line, source }
            })?;
            Ok(BearingReading { sweep, reading })
        })
        .collect()
}

/// σ of recorded numbers where the recording has none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReceptionConfig {
    /// σ of a received level in dB.
    pub rss_sigma_db: f64,
    /// σ of a ready-made bearing in radians.
    pub bearing_sigma: f64,
    /// Number of positions in a turn of the antenna.
    pub positions: u16,
    /// Errors of ready-made bearings; an extractor has its own.
    pub bearings: BearingCalibration,
    /// σ of the receiver's own East, North and Up in metres, for rows that have none
    /// ([`Record::receiver_sigma_m`](crate::recording::Record)); where absent it is
    /// [`GNSS_SIGMA_M`] for places in degrees, and places in metres are known.
    pub receiver_sigma_m: Option<f64>,
    /// True if the samples of a turn, and what was missed in it, are receptions of their own
    /// ([`Reception::of_samples`]) instead of one level and bearing.
    pub by_sample: bool,
}

impl Default for ReceptionConfig {
    /// 8 dB, 6°, 128 positions, bearings as they are, receivers as satellites place them, whole
    /// turns.
    ///
    /// Measured σ of bearings to tags at known places are 1.6° (Podruzny 1996), 4.9° and 9.9°
    /// (Grovenburg et al. 2013) and some 16°, of a mean error of 12.6° (Hystrix 23(2), 2012). Their
    /// geometric mean is 6°.
    fn default() -> Self {
        let bearing_sigma = 6.0_f64.to_radians();
        Self {
            rss_sigma_db: 8.0,
            bearing_sigma,
            positions: 128,
            bearings: BearingCalibration::default(),
            receiver_sigma_m: None,
            by_sample: false,
        }
    }
}

/// σ on each axis of a place that satellites give, in metres: what the receivers of phones state
/// under an open sky.
pub const GNSS_SIGMA_M: f64 = 3.0;

/// A reception, with the row of its recording.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedReception {
    /// The line of the row, or of the first one of the turn, from 1.
    pub line: u64,
    /// The receiver's name.
    pub drone: Arc<str>,
    /// The reception.
    pub reception: Reception,
}

/// Receptions of recordings with their rows, in little memory.
#[derive(Clone, Debug, Default)]
pub struct RecordedReceptions {
    receptions: Receptions,
    rows: Vec<RowOf>,
    drones: Vec<Arc<str>>,
}

/// The row of a reception.
#[derive(Clone, Copy, Debug)]
struct RowOf {
    line: u32,
    /// Index of the receiver's name.
    drone: u32,
}

impl RecordedReceptions {
    /// Adds a reception behind the others.
    pub fn push(&mut self, RecordedReception { line, drone, reception }: RecordedReception) {
        let known = self.drones.iter().position(|known| *known == drone);
        let index = known.unwrap_or(self.drones.len());
        if known.is_none() {
            self.drones.push(drone);
        }
        let line = u32::try_from(line).unwrap_or(u32::MAX);
        self.rows.push(RowOf { line, drone: u32::try_from(index).unwrap_or(u32::MAX) });
        self.receptions.push(reception);
    }

    /// Returns the receptions.
    #[must_use]
    pub fn receptions(&self) -> &Receptions {
        &self.receptions
    }

    /// Returns the receptions without their rows.
    #[must_use]
    pub fn into_receptions(self) -> Receptions {
        self.receptions
    }

    /// Returns a reception's line and receiver by its index; `None` behind the last.
    #[must_use]
    pub fn row(&self, index: usize) -> Option<(u64, &Arc<str>)> {
        let RowOf { line, drone } = self.rows.get(index)?;
        Some((u64::from(*line), self.drones.get(*drone as usize)?))
    }

    /// Returns the receptions with their rows.
    pub fn iter(&self) -> impl Iterator<Item = RecordedReception> {
        self.receptions.iter().zip(0..).filter_map(|(reception, index)| {
            let (line, drone) = self.row(index)?;
            Some(RecordedReception { line, drone: Arc::clone(drone), reception })
        })
    }

    /// Puts one receiver after the other by their names, each in the order of time.
    fn sort(self) -> Self {
        let mut keys = Vec::with_capacity(self.rows.len());
        for (index, reception) in self.receptions.iter().enumerate() {
            let drone = self.rows.get(index).map_or(0, |row| row.drone);
            keys.push((drone, reception.time, index));
        }
        let name = |drone: u32| self.drones.get(drone as usize);
        let order = |a: &(u32, f64, usize), b: &(u32, f64, usize)| {
            let drones = if a.0 == b.0 { Ordering::Equal } else { name(a.0).cmp(&name(b.0)) };
            drones.then(a.1.total_cmp(&b.1))
        };
        if keys.is_sorted_by(|a, b| order(a, b).is_le()) {
            return self;
        }
        keys.sort_by(order);
        let indices = || keys.iter().map(|key| key.2);
        Self {
            receptions: indices().filter_map(|index| self.receptions.get(index)).collect(),
            rows: indices().filter_map(|index| self.rows.get(index).copied()).collect(),
            drones: self.drones,
        }
    }
}

impl FromIterator<RecordedReception> for RecordedReceptions {
    fn from_iter<I: IntoIterator<Item = RecordedReception>>(rows: I) -> Self {
        let mut list = Self::default();
        rows.into_iter().for_each(|row| list.push(row));
        list
    }
}

impl Extend<RecordedReception> for RecordedReceptions {
    fn extend<I: IntoIterator<Item = RecordedReception>>(&mut self, rows: I) {
        rows.into_iter().for_each(|row| self.push(row));
    }
}

/// The receptions of one beacon: level and bearing of each turn of a directional antenna, the level
/// of each row of an omnidirectional one (a silence at the receiver's floor and below), ready-made
/// bearings, ranges and differences. One drone after the other, each in the order of time, so that
/// neighbours lie along one path.
///
/// # Errors
///
/// [`RecordedError`] names the file and the line of what cannot be used.
pub fn receptions(
    recordings: &[Recording],
    beacon: Option<&str>,
    extractor: &dyn BearingExtractor,
    config: &ReceptionConfig,
) -> Result<Receptions, RecordedError> {
    let mut all = Receptions::default();
    for recording in recordings {
        let of_one = recorded_receptions(recording, beacon, extractor, config)?;
        if all.is_empty() {
            all = of_one.receptions;
        } else {
            all.extend(&of_one.receptions);
        }
    }
    Ok(all)
}

/// The columns or files that would give the receivers of a recording their places.
fn places_wanted(recording: &Recording) -> String {
    let shipped = builtin_mappings().iter().find(|mapping| mapping.name == recording.format());
    let beside = shipped.into_iter().flat_map(|mapping| &mapping.beside);
    let names = |columns: &BTreeMap<Column, Source>| {
        columns.values().flat_map(|source| source.columns.clone()).collect::<Vec<_>>().join(",")
    };
    let of_places = |beside: &&Beside| beside.columns.contains_key(&Column::LatDeg);
    match beside.into_iter().find(of_places) {
        Some(beside) => format!(
            "write the receivers' places to {} beside the file ({},{}), or give the receiver's \
             path: foxhunt locate {} PATH",
            beside.file,
            names(&beside.by),
            names(&beside.columns),
            recording.file()
        ),
        None => "a place needs lat_deg and lon_deg, or east_m and north_m".to_owned(),
    }
}

/// The [`receptions`] of one recording, with their rows.
///
/// # Errors
///
/// [`RecordedError`] names the file and the line of what cannot be used.
pub fn recorded_receptions(
    recording: &Recording,
    beacon: Option<&str>,
    extractor: &dyn BearingExtractor,
    config: &ReceptionConfig,
) -> Result<RecordedReceptions, RecordedError> {
    let file = recording.file();
    let config = &ReceptionConfig {
        receiver_sigma_m: config
            .receiver_sigma_m
            .or(recording.is_in_degrees().then_some(GNSS_SIGMA_M)),
        ..*config
    };
    let no_place = |line| RecordedError::NoPlace {
        file: file.to_owned(),
        line,
        advice: places_wanted(recording),
    };
    let mut rows = RecordedReceptions::default();
    let mut order = 0.0;
    for record in recording.records() {
        order += 1.0;
        if record.beacon.as_deref() != beacon {
            continue;
        }
        // The level of a directional antenna is a part of its turn.
        if record.boresight.is_some() && record.measured.is_empty() {
            continue;
        }
        let receiver = record.receiver().ok_or_else(|| no_place(record.line))?;
        let time = record.time.unwrap_or(order);
        if let Some(reception) = from_record(record, time, receiver, config) {
            check(&reception, file, record.line)?;
            let drone = Arc::clone(&record.drone);
            rows.push(RecordedReception { line: record.line, drone, reception });
        }
    }
    if config.by_sample {
        for sweep in &recording.sweeps(config.positions)? {
            if sweep.beacon_name.as_deref() != beacon {
                continue;
            }
            if !sweep.located {
                return Err(no_place(sweep.line));
            }
            let drone: Arc<str> = sweep.drone.as_str().into();
            for reception in Reception::of_samples(&sweep.as_sweep(BeaconId(0))) {
                check(&reception, file, sweep.line)?;
                let drone = Arc::clone(&drone);
                rows.push(RecordedReception { line: sweep.line, drone, reception });
            }
        }
    } else if recording.records().iter().any(|record| record.boresight.is_some()) {
        for turn in &bearings(recording, extractor, config.positions)? {
            if turn.sweep.beacon_name.as_deref() != beacon {
                continue;
            }
            let line = turn.sweep.line;
            if !turn.sweep.located {
                return Err(no_place(line));
            }
            let receiver_sigma_m = config.receiver_sigma_m.map(Vector3::repeat);
            let sweep = turn.sweep.as_sweep(BeaconId(0));
            let reception = Reception { receiver_sigma_m, ..Reception::new(&sweep, &turn.reading) };
            check(&reception, file, line)?;
            let drone: Arc<str> = turn.sweep.drone.as_str().into();
            rows.push(RecordedReception { line, drone, reception });
        }
    }
    Ok(rows.sort())
}

/// The reception of one row, if it holds a measurement; without what belongs to a turn.
fn from_record(
    record: &Record,
    time: f64,
    receiver: Pose,
    config: &ReceptionConfig,
) -> Option<Reception> {
    let directional = record.boresight.is_some();
    let level = record.rss_dbm.filter(|_| !directional);
    let floor = record.floor_dbm.filter(|_| !directional);
    // At the floor, and where there is no level, nothing but the receiver's noise was measured.
    let (level, silence) = match (level, floor) {
        (Some(level), Some(floor)) if level <= floor => (None, Some(floor)),
        (None, floor) => (None, floor),
        (level, _) => (level, None),
    };
    let saturation = record.ceiling_dbm.filter(|ceiling| level.is_some_and(|l| l >= *ceiling));
    let level = level.filter(|_| saturation.is_none());
    let with_sigma = |rss_dbm| Level { rss_dbm, sigma_db: config.rss_sigma_db };
    let bearing = record.bearing.filter(|_| !directional).map(|bearing| {
        let calibration = &config.bearings;
        let sigma = bearing.sigma.map(|sigma| match bearing.is_calibrated {
            true => sigma,
            false => calibration.sigma(sigma),
        });
        let angle = match bearing.is_calibrated {
            true => bearing.angle,
            false => calibration.offset().correct(bearing.angle, receiver.heading),
        };
        Bearing { angle, sigma: sigma.unwrap_or(config.bearing_sigma), confidence: 1.0 }
    });
    if level.or(silence).or(saturation).is_none() && bearing.is_none() && record.measured.is_empty()
    {
        return None;
    }
    Some(Reception {
        time,
        receiver,
        level: level.map(with_sigma),
        silence: silence.map(with_sigma),
        saturation: saturation.map(with_sigma),
        bearing,
        receiver_sigma_m: record.receiver_sigma_m.or(config.receiver_sigma_m).map(Vector3::repeat),
        measured: record.measured,
        ..Reception::default()
    })
}

/// Refuses a reception of which no observation can be made.
fn check(reception: &Reception, file: &str, line: u64) -> Result<(), RecordedError> {
    let wrong = |source| RecordedError::Observation { file: file.to_owned(), line, source };
    if reception.has_bearing() {
        ByQuantity([Quantity::RSS, Quantity::BEARING]).observation(reception).map_err(wrong)?;
    } else {
        // There may be millions of levels alone.
        reception.check_level().map_err(wrong)?;
    }
    if reception.measured.is_empty() {
        return Ok(());
    }
    ByQuantity([Quantity::RANGE, Quantity::RANGE_DIFFERENCE, Quantity::RSS_DIFFERENCE])
        .observation(reception)
        .map_err(wrong)?;
    Ok(())
}

/// A receiver that has moved by less than this stays where it is, in metres.
const STILL_M: f64 = 1.0;

/// The receivers that stay in one place throughout a recording: they listen from their first record
/// to their last, whatever beacon those are of, down to the lowest level of all receptions there.
#[must_use]
pub fn listeners(recordings: &[Recording], receptions: &Receptions) -> Vec<Listener> {
    let mut listeners = Vec::new();
    for recording in recordings {
        for drone in recording.drones() {
            let records = || recording.records().iter().filter(|record| &*record.drone == drone);
            let Some(receiver) = records().find_map(|record| record.receiver()) else { continue };
            let is_here = |place: Vector3<f64>| (place - receiver.position).norm() < STILL_M;
            let stays = |record: &Record| record.receiver().is_some_and(|r| is_here(r.position));
            let times = || records().filter_map(|record| record.time);
            if !records().all(stays) {
                continue;
            }
            let here = receptions.views().filter(|view| is_here(view.position));
            let floor_dbm = here.filter_map(|view| view.level_dbm()).fold(f64::INFINITY, f64::min);
            if floor_dbm.is_finite() {
                let from = times().fold(f64::INFINITY, f64::min);
                let until = times().fold(f64::NEG_INFINITY, f64::max);
                listeners.push(Listener { receiver, from, until, floor_dbm });
            }
        }
    }
    listeners
}
