//! Stations fitted together to their bursts, and how well each is known.

use alloc::vec::Vec;
use core::f64::consts::FRAC_PI_2;

use foxhunt_core::angle;

use super::{
    StationBurst, StationRecord,
    pool::{Pool, likeliest_scale},
};
use crate::{CalibrationError, StationModel, StationPattern, calibration::statistics::quantile};

/// Largest half interval of a boresight that is known.
const KNOWN_BORESIGHT: f64 = FRAC_PI_2;

/// Largest gain that is believed, in standard deviations of gains: one in 2000 is beyond.
const BELIEVED_GAIN: f64 = 3.5;

/// Bursts that are needed of all stations together.
const NEEDED: usize = 8;

/// Largest number of groups that are left out one after the other; more are joined.
const MOST_GROUPS: usize = 20;

/// Stations of one make, fitted together.
#[derive(Clone, Debug, PartialEq)]
pub struct StationsFit {
    /// Common pattern of the stations, for stations that were not fitted.
    pub model: StationModel,
    /// Each station, in the order of the records.
    pub stations: Vec<StationFit>,
}

/// A station's pattern fitted to bursts, and how well it is known.
#[derive(Clone, Debug, PartialEq)]
pub struct StationFit {
    /// The pattern, ready to take bearings with: the station's own, or that of the common model if
    /// there are doubts.
    pub pattern: StationPattern,
    /// Half the 95 % interval of each boresight in radians: the larger one of that of the
    /// posterior, and of a jackknife over the groups, or over ten runs of consecutive bursts where
    /// there are fewer than three, with Student's t. Bursts of one walk share their reflections; to
    /// take each for itself would promise too much.
    pub boresight_half_intervals: Vec<f64>,
    /// Numbers that the bursts did not determine.
    pub doubts: Vec<StationDoubt>,
    /// The group of each burst, counted from 0.
    pub groups: Vec<usize>,
    /// The pattern fitted without each of the groups: to judge bearings by bursts to which it was
    /// not fitted.
    pub without: Vec<StationPattern>,
}

/// Reason why a station is not believed to differ from the common model as it was fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StationDoubt {
    /// A boresight is not known to within a quarter of a turn.
    Boresight {
        /// Index of the antenna.
        antenna: usize,
        /// Half the 95 % interval of its boresight, in radians.
        half_interval: f64,
    },
    /// A gain is beyond the spread of all gains.
    Gain {
        /// Index of the antenna.
        antenna: usize,
        /// The gain in dB.
        gain_db: f64,
        /// The largest one that is believed.
        believed_db: f64,
    },
}

/// Fits stations of fixed antennas together to bursts from known directions. They share the lobe
/// (beamwidth, front-to-back ratio), the receivers' floor and the scale of the residuals; each
/// antenna has its boresight and gain, and the effect of its site.
///
/// Boresights differ from the recorded ones by N(0, κ²), gains by N(0, τ²). Both spreads are
/// learned from all stations by marginal likelihood: recorded boresights that are no more than
/// labels make κ large, and a station of few bursts, or of a single antenna, stays near what is
/// recorded. The level of each burst is free. Residuals have the tails of a Student's t; antennas
/// that received nothing take part as powers below the floor, imputed by expectation and
/// maximisation (Dempster, Laird & Rubin 1977). Each boresight starts where the bursts come from
/// that the antenna received best, and is looked for all over the circle.
///
/// # Errors
///
/// Names the number that is not finite, or states that there are too few bursts of stations with
/// several antennas.
pub fn fit_stations(records: &[StationRecord]) -> Result<StationsFit, CalibrationError> {
    check(records)?;
    let recorded: Vec<&[f64]> = records.iter().map(|record| &record.recorded[..]).collect();
    let bursts: Vec<Vec<&StationBurst>> =
        records.iter().map(|record| record.bursts.iter().collect()).collect();
    let mut pool = Pool::fitted(&recorded, &bursts);
    let (groups, count) = groups(records);
    let mut without: Vec<Pool> = (0..count)
        .map(|left_out| {
            let each = bursts.iter().zip(&groups);
            let rest: Vec<_> =
                each.map(|(own, groups)| chosen(own, groups, |group| group != left_out)).collect();
            pool.refitted(&rest)
        })
        .collect();
    let left_out: Vec<Vec<Vec<&StationBurst>>> = (0..count)
        .map(|left_out| {
            let each = bursts.iter().zip(&groups);
            each.map(|(own, groups)| chosen(own, groups, |group| group == left_out)).collect()
        })
        .collect();
    // Bursts that had no part in a fit show how far it is off.
    let scale = likeliest_scale(pool.scale(), |scale| {
        let each = without.iter().zip(&left_out);
        each.map(|(pool, bursts)| pool.log_likelihood(bursts, scale)).sum()
    });
    without.iter_mut().chain([&mut pool]).for_each(|pool| pool.set_scale(scale));
    let model = pool.model();
    let models: Vec<StationModel> = without.iter().map(Pool::model).collect();
    let mut stations = Vec::with_capacity(records.len());
    for (index, (record, groups)) in records.iter().zip(groups).enumerate() {
        let own = pool.pattern(index)?;
        let without: Vec<StationPattern> =
            without.iter().map(|pool| pool.pattern(index)).collect::<Result<_, _>>()?;
        let half_intervals = half_intervals(&own, &without, &groups);
        let doubts = doubts(&own, &half_intervals, model.gain_sigma_db);
        let (pattern, without) = if doubts.is_empty() {
            (own, without)
        } else {
            let as_model = |model: &StationModel| model.pattern(&record.recorded);
            let without = models.iter().map(as_model).collect::<Result<_, _>>();
            (
                as_model(&model).map_err(CalibrationError::Station)?,
                without.map_err(CalibrationError::Station)?,
            )
        };
        stations.push(StationFit {
            pattern,
            boresight_half_intervals: half_intervals,
            doubts,
            groups,
            without,
        });
    }
    Ok(StationsFit { model, stations })
}

/// Returns the bursts of some groups.
fn chosen<'a>(
    bursts: &[&'a StationBurst],
    groups: &[usize],
    wanted: impl Fn(usize) -> bool,
) -> Vec<&'a StationBurst> {
    let kept = bursts.iter().zip(groups).filter(|(_, group)| wanted(**group));
    kept.map(|(burst, _)| *burst).collect()
}

/// Half the 95 % interval of each boresight.
fn half_intervals(own: &StationPattern, without: &[StationPattern], groups: &[usize]) -> Vec<f64> {
    let left_out = |group: &usize| groups.contains(group);
    let half_interval = |(antenna, fitted): (usize, &crate::StationAntenna)| {
        let boresight = |pattern: &StationPattern| {
            pattern.antennas().get(antenna).map_or(0.0, |own| own.boresight)
        };
        let moved: Vec<f64> = without
            .iter()
            .enumerate()
            .filter(|(group, _)| left_out(group))
            .map(|(_, one)| angle::wrap(boresight(one) - fitted.boresight))
            .collect();
        let of_groups = if moved.len() < 3 { 0.0 } else { jackknife(&moved) };
        of_groups.max(1.96 * fitted.boresight_sigma)
    };
    own.antennas().iter().enumerate().map(half_interval).collect()
}

/// Numbers of a station that are not known.
fn doubts(own: &StationPattern, half_intervals: &[f64], gain_sigma_db: f64) -> Vec<StationDoubt> {
    let believed_db = BELIEVED_GAIN * gain_sigma_db;
    let mut doubts = Vec::new();
    for (antenna, (fitted, &half_interval)) in own.antennas().iter().zip(half_intervals).enumerate()
    {
        if half_interval.is_nan() || half_interval > KNOWN_BORESIGHT {
            doubts.push(StationDoubt::Boresight { antenna, half_interval });
        }
        let gain_db = fitted.gain_db;
        if gain_db.is_nan() || gain_db.abs() > believed_db {
            doubts.push(StationDoubt::Gain { antenna, gain_db, believed_db });
        }
    }
    doubts
}

/// Half the 95 % interval from what an estimate moves when one of the groups is left out (Efron &
/// Tibshirani 1993, §11.5).
fn jackknife(moved: &[f64]) -> f64 {
    let n = moved.iter().map(|_| 1.0).sum::<f64>();
    let mean = moved.iter().sum::<f64>() / n;
    let squares: f64 = moved.iter().map(|value| (value - mean) * (value - mean)).sum();
    let error = libm::sqrt((n - 1.0) / n * squares);
    quantile(n - 1.0, 0.95).map_or(f64::INFINITY, |t| t * error)
}

/// The group of each burst of each station, counted from 0, and their number: the burst's own
/// group, or, where there are fewer than three, one of ten runs of the station's bursts.
fn groups(records: &[StationRecord]) -> (Vec<Vec<usize>>, usize) {
    let mut names: Vec<i64> = Vec::new();
    for burst in records.iter().flat_map(|record| &record.bursts) {
        if let Err(place) = names.binary_search(&burst.group) {
            names.insert(place, burst.group);
        }
    }
    if names.len() >= 3 {
        let count = names.len().min(MOST_GROUPS);
        let group = |burst: &StationBurst| {
            let place = names.binary_search(&burst.group).unwrap_or_default();
            count * place / names.len()
        };
        let of = |record: &StationRecord| record.bursts.iter().map(group).collect();
        return (records.iter().map(of).collect(), count);
    }
    let longest = records.iter().map(|record| record.bursts.len()).max().unwrap_or_default();
    let count = longest.min(10);
    let runs = |record: &StationRecord| {
        let own = record.bursts.len();
        (0..own).map(|index| count * index / own).collect()
    };
    (records.iter().map(runs).collect(), count)
}

fn check(records: &[StationRecord]) -> Result<(), CalibrationError> {
    let field = |index, field, value| {
        Err(CalibrationError::Field { index, field, value, requirement: "finite" })
    };
    let mut points = 0;
    for StationRecord { recorded, bursts } in records {
        for (index, boresight) in recorded.iter().enumerate() {
            if !boresight.is_finite() {
                return field(index, "recorded boresight", *boresight);
            }
        }
        for (index, burst) in bursts.iter().enumerate() {
            if !burst.truth.is_finite() {
                return field(index, "true bearing", burst.truth);
            }
            let mut readings = burst.readings_dbm.iter().flatten();
            if let Some(bad) = readings.find(|value| !value.is_finite()) {
                return field(index, "reading", *bad);
            }
            let received = burst.readings_dbm.iter().any(Option::is_some);
            points += usize::from(recorded.len() > 1 && received);
        }
    }
    if points < NEEDED {
        return Err(CalibrationError::TooFew { points, needed: NEEDED });
    }
    Ok(())
}
