use alloc::{vec, vec::Vec};

use foxhunt_core::angle::{self, Resultant};

use super::{
    floor::{Chance, Floor},
    shape::{Shape, Term},
};
use crate::{CalibrationError, StationPattern, calibration::student, extractor::TAIL};

/// A burst of the transmitter as a station received it.
#[derive(Clone, Debug, PartialEq)]
pub struct StationBurst {
    /// The direction from the station to the transmitter, in radians counter-clockwise from East.
    pub truth: f64,
    /// The day, or another name for bursts that belong together and go through the same places.
    pub group: i64,
    /// The reading of each antenna in dBm; `None` where it received nothing.
    pub readings_dbm: Vec<Option<f64>>,
}

/// A station's pattern fitted to bursts, and how well it is known.
#[derive(Clone, Debug, PartialEq)]
pub struct StationFit {
    /// The pattern, ready to take bearings with.
    pub pattern: StationPattern,
    /// Half the 95 % interval of each boresight in radians: a jackknife over the groups, or over
    /// ten runs of consecutive bursts where there are fewer than three, with Student's t. Bursts of
    /// one walk share their reflections; to take each for itself would promise too much.
    pub boresight_half_intervals: Vec<f64>,
    /// The group of each burst, counted from 0.
    pub groups: Vec<usize>,
    /// The pattern fitted without each of the groups: to judge bearings by bursts to which it was
    /// not fitted.
    pub without: Vec<StationPattern>,
}

/// Fits boresights, gains, beamwidth, front-to-back ratio and the site's effect on each antenna to
/// bursts from known directions; with them the receivers' floor and the scale of the residuals.
///
/// The level of each burst is free. Residuals have the tails of a Student's t; antennas that
/// received nothing take part as powers below the floor, imputed by expectation and maximisation
/// (Dempster, Laird & Rubin 1977). `recorded` are the antennas' boresights as recordings have them,
/// in radians; they name the antennas and are not believed: each starts where the bursts come from
/// that it received best.
///
/// # Errors
///
/// Names the number that is not finite, or states that there are too few bursts.
pub fn fit_station(
    recorded: &[f64],
    bursts: &[StationBurst],
) -> Result<StationFit, CalibrationError> {
    check(recorded, bursts)?;
    let all: Vec<&StationBurst> = bursts.iter().collect();
    let pattern = fit(recorded, &all)?;
    let groups = groups(bursts);
    let count = groups.iter().max().map_or(0, |last| last + 1);
    let without = (0..count)
        .map(|left_out| {
            let others = bursts.iter().zip(&groups).filter(|(_, group)| **group != left_out);
            let rest: Vec<&StationBurst> = others.map(|(burst, _)| burst).collect();
            fit(recorded, &rest)
        })
        .collect::<Result<Vec<_>, _>>()?;
    let half_interval = |antenna: usize| {
        let boresight = |pattern: &StationPattern| {
            pattern.antennas().get(antenna).map_or(0.0, |own| own.boresight)
        };
        let moved = without.iter().map(|one| angle::wrap(boresight(one) - boresight(&pattern)));
        jackknife(&moved.collect::<Vec<_>>())
    };
    let boresight_half_intervals = (0..recorded.len()).map(half_interval).collect();
    Ok(StationFit { pattern, boresight_half_intervals, groups, without })
}

/// Half the 95 % interval from what an estimate moves when one of the groups is left out (Efron &
/// Tibshirani 1993, §11.5).
fn jackknife(moved: &[f64]) -> f64 {
    let n = moved.iter().map(|_| 1.0).sum::<f64>();
    let mean = moved.iter().sum::<f64>() / n;
    let squares: f64 = moved.iter().map(|value| (value - mean) * (value - mean)).sum();
    let error = libm::sqrt((n - 1.0) / n * squares);
    student::quantile(n - 1.0, 0.95).map_or(f64::INFINITY, |t| t * error)
}

/// The group of each burst, counted from 0: its own, or one of ten runs.
fn groups(bursts: &[StationBurst]) -> Vec<usize> {
    let mut names: Vec<i64> = Vec::new();
    let mut place = |name: i64| {
        names.iter().position(|known| *known == name).unwrap_or_else(|| {
            names.push(name);
            names.len() - 1
        })
    };
    let own: Vec<usize> = bursts.iter().map(|burst| place(burst.group)).collect();
    if names.len() >= 3 {
        return own;
    }
    (0..bursts.len()).map(|index| 10 * index / bursts.len()).collect()
}

fn check(recorded: &[f64], bursts: &[StationBurst]) -> Result<(), CalibrationError> {
    let field = |index, field, value| {
        Err(CalibrationError::Field { index, field, value, requirement: "finite" })
    };
    for (index, boresight) in recorded.iter().enumerate() {
        if !boresight.is_finite() {
            return field(index, "recorded boresight", *boresight);
        }
    }
    for (index, burst) in bursts.iter().enumerate() {
        if !burst.truth.is_finite() {
            return field(index, "true bearing", burst.truth);
        }
        if let Some(bad) = burst.readings_dbm.iter().flatten().find(|value| !value.is_finite()) {
            return field(index, "reading", *bad);
        }
    }
    // Four for each of an antenna's numbers, boresight and gain, in the antennas' own bursts.
    let needed = 8 * recorded.len();
    let useful = bursts.iter().filter(|burst| burst.readings_dbm.iter().any(Option::is_some));
    let points = useful.count();
    if points < needed { Err(CalibrationError::TooFew { points, needed }) } else { Ok(()) }
}

/// Rounds of the fit, of which the last ones learn the site too.
const ROUNDS: u32 = 80;
const SITE_FROM: u32 = 55;

fn fit(recorded: &[f64], bursts: &[&StationBurst]) -> Result<StationPattern, CalibrationError> {
    let mut shape = Shape::new(recorded, start(recorded, bursts));
    let weakest = bursts.iter().flat_map(|b| b.readings_dbm.iter().flatten());
    let weakest = weakest.fold(f64::INFINITY, |a, &b| a.min(b));
    let mut floor = Floor { dbm: weakest + 1.0, width_db: 2.0 };
    let mut scale = 6.0;
    let mut levels: Vec<f64> = bursts.iter().map(|burst| first_level(&shape, burst)).collect();
    for round in 0..ROUNDS {
        let mut terms: Vec<Vec<Term>> = vec![Vec::with_capacity(bursts.len()); recorded.len()];
        let mut squares = 0.0;
        let mut freedom = 0.0;
        for (burst, level) in bursts.iter().zip(&mut levels) {
            let mut sum = 0.0;
            let mut weights = 0.0;
            let mut measured = 0.0;
            let mut own = Vec::with_capacity(recorded.len());
            for (antenna, reading) in burst.readings_dbm.iter().enumerate().take(recorded.len()) {
                let gain = shape.gain(antenna, burst.truth);
                let expected = *level + gain;
                let value = reading.unwrap_or_else(|| floor.imputed(expected, scale));
                let off = (value - expected) / scale;
                let weight = (TAIL + 1.0) / (TAIL + off * off);
                sum += weight * (value - gain);
                weights += weight;
                if reading.is_some() {
                    measured += 1.0;
                    squares += weight * (value - expected) * (value - expected);
                }
                own.push((value, weight));
            }
            *level = sum / weights;
            freedom += (measured - 1.0_f64).max(0.0);
            for (terms, (value, weight)) in terms.iter_mut().zip(own) {
                let rest_db = value - *level;
                terms.push(Term { direction: burst.truth, rest_db, weight });
            }
        }
        if round > 2 {
            scale = libm::sqrt(squares / freedom.max(1.0)).clamp(0.1, 30.0);
        }
        let variance = scale * scale;
        if round < SITE_FROM {
            shape.turn(&terms, variance);
            shape.stretch(&terms, variance);
        } else {
            shape.learn_site(&terms, variance);
        }
        if round % 20 == 19 {
            let chances = bursts.iter().zip(&levels).flat_map(|(burst, level)| {
                let shape = &shape;
                burst.readings_dbm.iter().enumerate().map(move |(antenna, reading)| {
                    let expected = level + shape.gain(antenna, burst.truth);
                    reading.map_or(Chance::Silent(expected), Chance::Received)
                })
            });
            floor = floor.fitted(chances, scale);
        }
    }
    StationPattern::new(shape.antennas, shape.beamwidth, shape.front_to_back_db)
        .and_then(|pattern| pattern.with_residual_db(scale))
        .and_then(|pattern| pattern.with_floor(floor.dbm, floor.width_db))
        .map_err(CalibrationError::Station)
}

/// Mean direction of the bursts that each antenna received stronger than any other did; its
/// recorded boresight if there is no such burst.
fn start(recorded: &[f64], bursts: &[&StationBurst]) -> Vec<f64> {
    let mut best = vec![Resultant::default(); recorded.len()];
    for burst in bursts {
        let readings = burst.readings_dbm.iter().enumerate();
        let strongest = readings
            .filter_map(|(antenna, reading)| Some((antenna, (*reading)?)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some(resultant) = strongest.and_then(|(antenna, _)| best.get_mut(antenna)) {
            resultant.add(burst.truth, 1.0);
        }
    }
    recorded.iter().zip(best).map(|(own, best)| best.direction(0.2).unwrap_or(*own)).collect()
}

/// The level at which the antenna of the largest gain gives the strongest reading.
fn first_level(shape: &Shape, burst: &StationBurst) -> f64 {
    let strongest = burst.readings_dbm.iter().flatten().fold(-200.0_f64, |a, &b| a.max(b));
    let gains = (0..shape.antennas.len()).map(|antenna| shape.gain(antenna, burst.truth));
    strongest - gains.fold(f64::NEG_INFINITY, f64::max)
}
