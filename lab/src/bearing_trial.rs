//! Simulated turns of an antenna, and what the extractors make of them.
//!
//! No drone flies: each turn has its transmitter and its nose in newly drawn directions, 6 readings
//! of 2 dB along each boresight, and what the case is named for. Every extractor reads the same
//! turns.

use std::f64::consts::{PI, TAU};

use foxhunt_core::{BeaconId, Pose, Sample, Sweep, angle};
use foxhunt_filters::consistency::Coverage;
use foxhunt_hunt::{
    config::{BoxedExtractor, ExtractorConfigError},
    registry::{ExtractorEntry, Registry},
};
use foxhunt_sensors::{
    Antenna, AntennaConfig, AntennaError, Correlation, LogDistance, SharedAntenna,
};
use foxhunt_sim::{BeaconConfig, ChannelConfig, DroneConfig, ScatteringConfig, World, WorldConfig};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;
use statrs::statistics::{Data, OrderStatistics, Statistics};

use crate::{Experiment, Runner, ThreadsError, campaign::Repetition};

/// Half a degree: what the gain's slope is computed over, in radians.
const SLOPE_STEP: f64 = 0.0087;

/// The disturbances of the turns in a campaign of bearings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BearingCase {
    /// Name of the case, as `foxhunt compare extractors` takes it.
    pub name: &'static str,
    /// Description of the case, in a line.
    pub about: &'static str,
    /// The number of distinct boresights of a turn, equally spaced.
    pub boresights: u16,
    /// The share of boresights without a reading, each by chance.
    pub lost: f64,
    /// The share of the circle, in one piece, without a reading.
    pub blocked: f64,
    /// The amplitude of a reflection over that of the direct wave.
    pub reflected: f64,
    /// The waves that surroundings scatter beside the direct one; none if absent.
    pub scattering: Option<ScatteringConfig>,
}

impl BearingCase {
    /// The number of positions of a turn that the boresights are sorted into.
    pub const POSITIONS: u16 = 128;

    /// The number of readings of each boresight.
    pub const READINGS: u16 = 6;

    /// σ of a reading in dB.
    pub const SIGMA_DB: f64 = 2.0;
}

/// A simulated turn.
#[derive(Clone, Debug)]
struct Turn {
    samples: Vec<Sample>,
    /// The transmitter's true bearing, in radians.
    bearing: f64,
    /// The Cramér-Rao bound on the variance of its bearing with a known antenna, an unknown level
    /// and no reflection, in rad².
    bound: f64,
}

impl Turn {
    /// The mean level of a turn without a reflection, in dBm.
    const LEVEL_DBM: f64 = -60.0;

    /// The turn of a case that a seed draws.
    fn draw(case: &BearingCase, antenna: &SharedAntenna, seed: u64) -> Self {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut any = || rng.random_range(-PI..PI);
        let bearing = any();
        let heading = any();
        let mirror = any();
        let phase = any();
        let block = any();
        let mean_db = antenna.mean_gain_db(0.0);
        let gain_db = |off: f64| antenna.gain_dbi(off, 0.0) - mean_db;
        let amplitude = |off: f64| 10.0_f64.powf(gain_db(off) / 20.0);
        let step = TAU / f64::from(case.boresights);
        let world = case.scattering.map(|scattering| scattered(scattering, seed));
        let mut samples = Vec::new();
        let mut slopes = Vec::new();
        for index in 0..case.boresights {
            let turned = step * f64::from(index);
            let boresight = angle::wrap(heading + turned);
            let is_blocked = (turned - block).rem_euclid(TAU) < case.blocked * TAU;
            let is_lost = rng.random::<f64>() < case.lost;
            let direct = amplitude(bearing - boresight);
            let reflected = case.reflected * amplitude(mirror - boresight);
            let in_phase = direct + reflected * phase.cos();
            let power = in_phase * in_phase + (reflected * phase.sin()).powi(2);
            let power_dbm = Self::LEVEL_DBM
                + match &world {
                    Some(world) => through(world, antenna, boresight - bearing),
                    None => 10.0 * power.log10(),
                };
            for _ in 0..BearingCase::READINGS {
                // Drawn whether it is received or not: a turn with losses is the clean one with
                // gaps.
                let noise: f64 = StandardNormal.sample(&mut rng);
                if is_lost || is_blocked {
                    continue;
                }
                samples.push(Sample {
                    time: f64::from(index),
                    receiver: Pose { heading, ..Pose::default() },
                    boresight,
                    position: angle::nearest_position(turned, BearingCase::POSITIONS),
                    rss_dbm: power_dbm + BearingCase::SIGMA_DB * noise,
                });
            }
            if !(is_lost || is_blocked) {
                let off = bearing - boresight;
                slopes.push(
                    (gain_db(off + SLOPE_STEP) - gain_db(off - SLOPE_STEP)) / (2.0 * SLOPE_STEP),
                );
            }
        }
        Self { samples, bearing, bound: bound(&slopes) }
    }

    fn as_sweep(&self) -> Sweep<'_> {
        Sweep {
            beacon: BeaconId(0),
            time: f64::from(BearingCase::POSITIONS),
            positions: BearingCase::POSITIONS,
            samples: &self.samples,
            ..Sweep::default()
        }
    }
}

/// The results of a campaign of bearings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BearingReport {
    /// The case's name.
    pub campaign: String,
    /// The number of turns that each extractor read.
    pub runs: u32,
    /// The seed of the first turn; turn i has this plus i.
    pub seed: u64,
    /// The root mean square of the Cramér-Rao bound with a known antenna, an unknown level and no
    /// reflection, in degrees.
    pub bound_deg: f64,
    /// The extractors, in the order of the call.
    pub extractors: Vec<ExtractorReport>,
}

/// The results of one extractor. Figures that so few bearings do not give are absent.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExtractorReport {
    /// The extractor's name.
    pub extractor: String,
    /// The root mean square error in degrees.
    pub rms_deg: Option<f64>,
    /// The median of the error's magnitude in degrees.
    pub median_deg: Option<f64>,
    /// The root mean square of σ in degrees.
    pub sigma_deg: Option<f64>,
    /// The root mean square of error over σ: 1 for an honest one, more for an over-confident one.
    pub sigma_ratio: Option<f64>,
    /// The share of errors within 1.96 σ, the 95 % interval of a Gaussian; σ is that of all
    /// competing directions together where there are several.
    pub coverage_95: Option<f64>,
    /// The 95 % interval of the true share.
    pub coverage_95_interval: Option<[f64; 2]>,
    /// The number of errors that exceed 4 σ.
    pub beyond_4_sigma: u32,
    /// The number of turns with more than one direction.
    pub ambiguous: u32,
    /// Pearson's correlation of σ and the error's magnitude (Pritzl 2018, eq. 4.3).
    pub correlation: Option<f64>,
    /// The probability of a correlation as far from 0 by chance: two-sided, by Student's t.
    pub correlation_p: Option<f64>,
    /// The mean error of the level in dB against the direct wave's.
    pub level_bias_db: Option<f64>,
    /// The number of turns without a bearing.
    pub refused: u32,
}

/// One bearing against the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BearingError {
    /// The error in radians, with its sign.
    error: f64,
    sigma: f64,
    ambiguous: bool,
    level_error_db: f64,
}

impl ExtractorReport {
    /// The statistics of some turns, `None` where there was no bearing.
    fn of(name: &str, turns: &[Option<BearingError>]) -> Self {
        let found: Vec<&BearingError> = turns.iter().flatten().collect();
        let column = |value: fn(&BearingError) -> f64| -> Vec<f64> {
            found.iter().map(|f| value(f)).collect()
        };
        let count = |holds: fn(&BearingError) -> bool| {
            u32::try_from(found.iter().filter(|f| holds(f)).count()).unwrap_or(u32::MAX)
        };
        let some = |value: f64| Some(value).filter(|value| value.is_finite());
        let magnitudes = column(|f| f.error.abs().to_degrees());
        let sigmas = column(|f| f.sigma.to_degrees());
        let mut coverage = Coverage::new(0.95, 0.95).expect("both are in (0, 1)");
        for one in &found {
            coverage.add(one.error.abs() <= 1.96 * one.sigma);
        }
        let correlation = Correlation::of(sigmas.iter().copied().zip(magnitudes.iter().copied()));
        let refused = u32::try_from(turns.len() - found.len()).unwrap_or(u32::MAX);
        Self {
            extractor: name.to_owned(),
            rms_deg: some(magnitudes.as_slice().quadratic_mean()),
            median_deg: (!found.is_empty()).then(|| Data::new(magnitudes.clone()).median()),
            sigma_deg: some(sigmas.as_slice().quadratic_mean()),
            sigma_ratio: some(column(|f| f.error / f.sigma).as_slice().quadratic_mean()),
            coverage_95: coverage.share(),
            coverage_95_interval: coverage.interval(),
            beyond_4_sigma: count(|f| f.error.abs() > 4.0 * f.sigma),
            ambiguous: count(|f| f.ambiguous),
            correlation: correlation.map(|c| c.coefficient),
            correlation_p: correlation.map(|c| c.p_value),
            level_bias_db: some(column(|f| f.level_error_db).as_slice().mean()),
            refused,
        }
    }
}

/// Turns of a case, each read by every extractor.
struct Turns<'a> {
    case: &'a BearingCase,
    antenna: SharedAntenna,
    extractors: &'a [BoxedExtractor],
}

impl Experiment for Turns<'_> {
    /// The turn's bound, and what each extractor reads.
    type Run = (f64, Vec<Option<BearingError>>);
    type Error = std::convert::Infallible;

    fn run(&self, seed: u64) -> Result<Self::Run, Self::Error> {
        let turn = Turn::draw(self.case, &self.antenna, seed);
        let read = self.extractors.iter().map(|extractor| read(extractor, &turn));
        Ok((turn.bound, read.collect()))
    }
}

/// The reason why there is no campaign of bearings.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BearingCampaignError {
    /// The threads could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
    /// The antenna cannot be built.
    #[error("the antenna: {0}")]
    Antenna(#[from] AntennaError),
    /// An extractor cannot be built.
    #[error(transparent)]
    Extractor(#[from] ExtractorConfigError),
}

/// Every case that has a name.
#[must_use]
pub fn bearing_cases() -> [BearingCase; 6] {
    let clean = BearingCase {
        name: "bearing-clean",
        about: "turns of 128 × 6 readings with nothing but noise",
        boresights: BearingCase::POSITIONS,
        lost: 0.0,
        blocked: 0.0,
        reflected: 0.0,
        scattering: None,
    };
    [
        clean,
        BearingCase {
            name: "bearing-lost",
            about: "turns with 30 % of the positions lost, each by chance",
            lost: 0.3,
            ..clean
        },
        BearingCase {
            name: "bearing-reflector",
            about: "turns with a reflection at half amplitude, its direction and phase by chance",
            reflected: 0.5,
            ..clean
        },
        BearingCase {
            name: "bearing-scattered",
            about: "turns between houses: K of 5 dB with a σ of 5 dB, six waves by chance",
            scattering: Some(ScatteringConfig {
                k_db: 5.0,
                k_sigma_db: 5.0,
                waves: 6,
                elevation_sigma_deg: 0.0,
            }),
            ..clean
        },
        BearingCase {
            name: "bearing-65",
            about: "turns of a body: 65 × 6 readings sorted into 128 positions",
            boresights: 65,
            ..clean
        },
        BearingCase {
            name: "bearing-block",
            about: "turns with 30 % of the circle missing in one piece, anywhere",
            blocked: 0.3,
            ..clean
        },
    ]
}

/// The case of a name.
#[must_use]
pub fn bearing_case_named(name: &str) -> Option<BearingCase> {
    bearing_cases().into_iter().find(|case| case.name == name)
}

/// A world without noise whose beacon is a metre to the East, at 0 dBm there: all that a seed draws
/// are the scattered waves.
fn scattered(scattering: ScatteringConfig, seed: u64) -> World {
    let law = LogDistance::new(0.0, 2.0).expect("the exponent is positive");
    let channel = ChannelConfig {
        path_loss: law.into(),
        scattering: Some(scattering),
        pattern_sigma_db: 0.0,
        sample_sigma_db: 0.0,
        bearing_sigma_deg: 0.0,
        ..ChannelConfig::default()
    };
    let beacons = vec![BeaconConfig { east_m: 1.0, ..BeaconConfig::default() }];
    let drones = vec![DroneConfig::default()];
    let config = WorldConfig { beacons, drones, channel, ..WorldConfig::default() };
    World::new(&config, seed).expect("its scattering is in order, and nothing else is unusual")
}

/// The gain over its mean of an antenna that looks `off` to the left of the direct wave, in dB.
fn through(world: &World, antenna: &SharedAntenna, off: f64) -> f64 {
    let read = world.receive(0, BeaconId(0), antenna, off).expect("drone and beacon are there");
    read.unwrap_or(f64::NEG_INFINITY)
}

/// σ² over Σ n (sᵢ − s̄)²: the mean slope goes into the level.
fn bound(slopes: &[f64]) -> f64 {
    let count = slopes.iter().map(|_| 1.0).sum::<f64>();
    let mean = slopes.iter().sum::<f64>() / count;
    let squares: f64 = slopes.iter().map(|slope| (slope - mean) * (slope - mean)).sum();
    BearingCase::SIGMA_DB.powi(2) / (f64::from(BearingCase::READINGS) * squares)
}

/// Draws turns of a case through an antenna, which those extractors are given that take one, and
/// has every extractor read each of them. The result does not depend on the number of threads.
///
/// # Errors
///
/// [`BearingCampaignError`] when the antenna or an extractor cannot be built.
pub fn bearing_campaign(
    registry: &Registry,
    case: &BearingCase,
    antenna: &AntennaConfig,
    extractors: &[ExtractorEntry],
    repetition: &Repetition<'_>,
) -> Result<BearingReport, BearingCampaignError> {
    let runner = Runner::new(repetition.jobs)?;
    let build = |entry: &ExtractorEntry| {
        let config = entry.config();
        registry.build_extractor(&config.clone().with_antenna(antenna).unwrap_or(config))
    };
    let built: Vec<BoxedExtractor> = extractors.iter().map(build).collect::<Result<_, _>>()?;
    let turns = Turns { case, antenna: antenna.build()?, extractors: &built };
    let turns = repetition.of(&runner, &turns).unwrap_or_else(|never| match never {});
    let reports = extractors.iter().enumerate().map(|(index, entry)| {
        let read: Vec<_> =
            turns.iter().map(|(_, read)| read.get(index).copied().flatten()).collect();
        ExtractorReport::of(&entry.name, &read)
    });
    let bounds = turns.iter().map(|(bound, _)| bound).sum::<f64>() / f64::from(repetition.runs);
    Ok(BearingReport {
        campaign: case.name.to_owned(),
        runs: repetition.runs,
        seed: repetition.seed,
        bound_deg: bounds.sqrt().to_degrees(),
        extractors: reports.collect(),
    })
}

/// A turn's bearing against the truth; `None` if it is refused.
fn read(extractor: &BoxedExtractor, turn: &Turn) -> Option<BearingError> {
    let reading = extractor.extract(&turn.as_sweep()).ok()?;
    let bearing = reading.bearing.ok()?;
    Some(BearingError {
        error: angle::wrap(bearing.angle - turn.bearing),
        sigma: bearing.sigma,
        ambiguous: !reading.modes.is_empty(),
        level_error_db: reading.rss_dbm - Turn::LEVEL_DBM,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(error: f64, sigma: f64) -> Option<BearingError> {
        Some(BearingError { error, sigma, ambiguous: false, level_error_db: 0.5 })
    }

    #[test]
    fn figures_are_those_of_the_errors() {
        let turns = [found(0.1, 0.1), found(-0.3, 0.1), None, found(0.5, 0.1), found(0.1, 0.2)];
        let report = ExtractorReport::of("x", &turns);
        let close = |a: Option<f64>, b: f64| a.is_some_and(|a| (a - b).abs() < 1e-9);
        assert!(close(report.rms_deg, 0.3_f64.to_degrees()), "{report:?}");
        assert!(close(report.sigma_ratio, ((1.0_f64 + 9.0 + 25.0 + 0.25) / 4.0).sqrt()));
        assert!(close(report.coverage_95, 0.5) && close(report.level_bias_db, 0.5));
        assert_eq!((report.refused, report.beyond_4_sigma), (1, 1));
        assert_eq!(ExtractorReport::of("x", &[None]).rms_deg, None);
        assert_eq!(ExtractorReport::of("x", &[None]).correlation, None);
    }
}
