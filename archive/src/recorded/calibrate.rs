use std::collections::BTreeMap;

use foxhunt_core::BearingExtractor;
use foxhunt_sensors::{CalibrationError, PathLossFit, fit_log_distance};
use nalgebra::{Matrix2, Vector2};

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

/// A fitted path loss, and over which ranges it was fitted. Its covariance is that of independent
/// points, or of points that fade together where their scatter over places shows that they do.
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
    let mut fit = fit_log_distance(pairs, config.max_exponent).map_err(|source| {
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
    widen_by_runs(&mut fit, &points, config.max_exponent);
    let nearest_m = points.iter().map(|point| point.range).fold(f64::INFINITY, f64::min);
    let farthest_m = points.iter().map(|point| point.range).fold(0.0, f64::max);
    Ok(Calibration { fit, nearest_m, farthest_m })
}

/// Number of runs of points, each through places that shade alike.
const RUNS: usize = 10;

/// Ratio of variances above which `runs` scatter more than independent points make them: the 95 %
/// quantile of the larger eigenvalue of a covariance of white numbers in two dimensions. It is 3.2,
/// 2.3, 1.9 and 1.6 for 5, 10, 20 and 40 runs (by simulation), 1 + 4 / √(runs − 1) to within
/// 0.2.
fn most_by_chance(runs: f64) -> f64 {
    1.0 + 4.0 / (runs - 1.0).sqrt()
}

/// Widens the covariance of the law to what it moves by where one run of points is left out (Efron
/// & Tibshirani 1993, §11.5), along the axes on which that is clearly more: points of one way, or
/// of one station, fade together.
fn widen_by_runs(fit: &mut PathLossFit, points: &[Point<'_>], max_exponent: Option<f64>) {
    let runs = runs(points);
    let count = runs.iter().max().map_or(0, |last| last + 1);
    let moved = (0..count).map(|run| {
        let others = points.iter().zip(&runs).filter(|(_, own)| **own != run);
        let pairs = others.map(|(point, _)| (point.range, point.rss_dbm));
        if fit.at_bound {
            let (sum, points) = pairs.fold((0.0, 0.0), |(sum, points), (range, rss_dbm)| {
                (sum + rss_dbm + 10.0 * fit.exponent * libm::log10(range), points + 1.0)
            });
            return (points > 0.0).then(|| Vector2::new(sum / points - fit.reference_dbm, 0.0));
        }
        let rest = fit_log_distance(pairs, max_exponent).ok()?;
        Some(Vector2::new(rest.reference_dbm - fit.reference_dbm, rest.exponent - fit.exponent))
    });
    let Some(moved) = moved.collect::<Option<Vec<_>>>() else { return };
    let n = f64::from(u32::try_from(count).unwrap_or(u32::MAX));
    if n < 4.0 {
        return;
    }
    let mean = moved.iter().sum::<Vector2<f64>>() / n;
    let squares: Matrix2<f64> =
        moved.iter().map(|step| (step - mean) * (step - mean).transpose()).sum();
    let of_runs = squares * ((n - 1.0) / n);
    // Student's t with n − 1 degrees of freedom has a variance larger by this.
    let tail = (n - 1.0) / (n - 3.0);
    let widened = |ratio: f64| if ratio > most_by_chance(n) { ratio * tail } else { 1.0 };
    if fit.at_bound {
        let [own, of_runs] = [fit.covariance.m11, of_runs.m11];
        fit.covariance.m11 = own * widened(of_runs / own.max(f64::MIN_POSITIVE));
        return;
    }
    let Some(factor) = fit.covariance.cholesky() else { return };
    let lower = factor.l();
    let Some(half) = lower.solve_lower_triangular(&of_runs) else { return };
    let Some(ratio) = lower.solve_lower_triangular(&half.transpose()) else { return };
    let mut axes = ratio.symmetric_eigen();
    axes.eigenvalues.apply(|ratio| *ratio = widened(*ratio));
    let widened = lower * axes.recompose() * lower.transpose();
    fit.covariance = 0.5 * (widened + widened.transpose());
}

/// Returns the run of each point, counted from 0: a receiver each where there are enough, else
/// equal parts in the order of the recordings.
fn runs(points: &[Point<'_>]) -> Vec<usize> {
    let mut names: Vec<[&str; 2]> = Vec::new();
    let mut of_receivers = Vec::with_capacity(points.len());
    for point in points {
        let name = [point.file, point.receiver];
        let known = names.iter().position(|own| *own == name);
        of_receivers.push(known.unwrap_or(names.len()));
        if known.is_none() {
            names.push(name);
        }
    }
    if names.len() >= RUNS {
        return of_receivers;
    }
    let parts = RUNS.min(points.len());
    (0..points.len()).map(|index| parts * index / points.len()).collect()
}

/// A level at a known range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownRange {
    /// Distance from the transmitter in metres.
    pub range_m: f64,
    /// The receiver's height in metres, where its place is recorded.
    pub up_m: Option<f64>,
    /// The level in dBm.
    pub rss_dbm: f64,
}

/// The levels at known ranges that [`calibrate`] fits.
///
/// # Errors
///
/// [`RecordedError`] names the file and line where a range is not known.
pub fn known_ranges(
    recordings: &[Recording],
    beacon: Option<&str>,
    extractor: &dyn BearingExtractor,
    config: &CalibrateConfig,
) -> Result<Vec<KnownRange>, RecordedError> {
    let mut points = Vec::new();
    for recording in recordings {
        add_points(recording, beacon, extractor, config, &mut points)?;
    }
    let known = |point: &Point<'_>| KnownRange {
        range_m: point.range,
        up_m: point.up_m,
        rss_dbm: point.rss_dbm,
    };
    Ok(points.iter().map(known).collect())
}

/// A power at a known range, and the line that it is from.
struct Point<'a> {
    range: f64,
    /// The receiver's height, where its place is recorded.
    up_m: Option<f64>,
    rss_dbm: f64,
    file: &'a str,
    line: u64,
    /// Name of the receiver; empty without one.
    receiver: &'a str,
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
        // Noise and clipped levels show no law.
        let is_noise = record.floor_dbm.is_some_and(|floor| rss_dbm <= floor);
        if is_noise || record.ceiling_dbm.is_some_and(|ceiling| rss_dbm >= ceiling) {
            continue;
        }
        let truth = config.truth.or(record.truth);
        let to = |t: Vector2<f64>| {
            record.receiver().map(|r| (t.push(config.target_up_m) - r.position).norm())
        };
        let range = record.known_range.or_else(|| truth.and_then(to));
        let range = range.ok_or_else(|| no_truth(record.line))?;
        let receiver = &*record.drone;
        let up_m = record.receiver().map(|receiver| receiver.position.z);
        points.push(Point { range, up_m, rss_dbm, file, line: record.line, receiver });
    }
    if chosen().any(|r| r.boresight.is_some()) {
        let truths: BTreeMap<u64, Vector2<f64>> =
            chosen().filter_map(|record| Some((record.line, record.truth?))).collect();
        let names: BTreeMap<u64, &str> =
            chosen().map(|record| (record.line, &*record.drone)).collect();
        for turn in bearings(recording, extractor, config.positions)? {
            if turn.sweep.beacon_name.as_deref() != beacon {
                continue;
            }
            let line = turn.sweep.line;
            let truth = config.truth.or_else(|| truths.get(&line).copied());
            let truth = truth.filter(|_| turn.sweep.located).ok_or_else(|| no_truth(line))?;
            let at = turn.sweep.sweep.receiver.position;
            let range = (truth.push(config.target_up_m) - at).norm();
            let receiver = names.get(&line).copied().unwrap_or_default();
            let rss_dbm = turn.reading.rss_dbm;
            points.push(Point { range, up_m: Some(at.z), rss_dbm, file, line, receiver });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
    use rand_distr::StandardNormal;

    use super::*;

    /// Share of 400 calibrations of 300 levels whose joint 95 % region holds the law, without and
    /// with the widening. The levels go to and fro between 50 and 400 m; their noise of 6 dB has
    /// this correlation from one to the next.
    fn held(correlation: f64) -> [f64; 2] {
        const DRAWS: u32 = 400;
        let mut held = [0.0; 2];
        for seed in 0..DRAWS {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(u64::from(seed));
            let mut noise: f64 = rng.sample(StandardNormal);
            let points: Vec<Point<'_>> = (0..300_u16)
                .map(|i| {
                    let fresh: f64 = rng.sample(StandardNormal);
                    noise = correlation * noise + (1.0 - correlation * correlation).sqrt() * fresh;
                    let range = 225.0 - 175.0 * (f64::from(i) / 12.0).cos();
                    let rss_dbm = -30.0 - 25.0 * range.log10() + 6.0 * noise;
                    Point { range, up_m: None, rss_dbm, file: "a", line: i.into(), receiver: "" }
                })
                .collect();
            let pairs = points.iter().map(|point| (point.range, point.rss_dbm));
            let mut fit = fit_log_distance(pairs, None).expect("ranges differ");
            for (number, held) in held.iter_mut().enumerate() {
                if number == 1 {
                    widen_by_runs(&mut fit, &points, None);
                }
                let off = Vector2::new(-30.0, 2.5) - Vector2::new(fit.reference_dbm, fit.exponent);
                let solved = fit.covariance.cholesky().expect("definite").solve(&off);
                // The 95 % quantile of χ² with two degrees of freedom; F with 298 differs by 1 %.
                *held += f64::from(u8::from(off.dot(&solved) <= 5.99)) / f64::from(DRAWS);
            }
        }
        held
    }

    #[test]
    fn levels_that_fade_together_tell_less() {
        let [alone, widened] = held(0.9);
        println!("correlated: {alone} and {widened}");
        // Neighbouring runs still share a part of their noise.
        assert!(alone < 0.3 && widened > 0.78, "{alone} {widened}");
        let [alone, widened] = held(0.0);
        println!("independent: {alone} and {widened}");
        assert!((0.92..0.98).contains(&alone) && widened - alone < 0.03, "{alone} {widened}");
    }
}
