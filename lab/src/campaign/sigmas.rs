use std::convert::Infallible;

use foxhunt_core::angle;
use foxhunt_hunt::{
    calibration::BearingCalibration,
    hunt::Event,
    registry::{EstimatorEntry, Registry},
    scenario::Scenario,
};
use foxhunt_sensors::{BearingError, Correlation, LogDistance, Propagation, fit_sigma};
use serde::Serialize;

use super::{CampaignError, EstimatorCampaign, Flown, Repetition, beacon_names, summarise};
use crate::{
    Experiment, Paired, Runner, Spread,
    simulation::{Setup, SimulationError},
};

/// The σ that bearings are fused with, in the question of the reference: is an uncertainty that is
/// read from the pattern worth more than a constant one (Pritzl 2018, §4.1)?
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SigmaSetup {
    /// The extractor's own σ, with the scenario's calibration if it has one.
    Own,
    /// The extractor's σ, scaled and with a floor so that it is as large as the errors are.
    Fitted,
    /// One σ for every bearing: the root mean square of the errors.
    Constant,
}

impl SigmaSetup {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Own, Self::Fitted, Self::Constant];

    /// Returns the name of the σ setup.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Own => "own",
            Self::Fitted => "fitted",
            Self::Constant => "constant",
        }
    }
}

/// A scenario's hunts with each σ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SigmasReport {
    /// The scenario's name.
    pub scenario: String,
    /// The number of hunts that each estimator flew with each σ.
    pub runs: u32,
    /// The seed of the first run; run i has this plus i, with every σ and estimator.
    pub seed: u64,
    /// The estimators, in the order of the call.
    pub estimators: Vec<SigmasCampaign>,
}

/// One estimator's hunts with each σ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SigmasCampaign {
    /// The estimator's name.
    pub estimator: String,
    /// The bearings of its hunts with their own σ; absent where there were fewer than three.
    pub bearings: Option<BearingStatistics>,
    /// Each σ with its hunts; σ that the bearings do not allow to make are left out.
    pub setups: Vec<SigmaCampaign>,
    /// The errors with a σ over those with the constant one.
    pub comparisons: Vec<SigmaComparison>,
}

/// The bearings of a campaign against the truth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BearingStatistics {
    /// The number of bearings.
    pub bearings: usize,
    /// The number of receptions without a bearing.
    pub without: usize,
    /// The root mean square of their errors, in degrees.
    pub rms_deg: f64,
    /// The mean of their own σ, in degrees.
    pub sigma_deg: f64,
    /// Pearson's correlation of σ and the error's magnitude over all bearings (Pritzl 2018,
    /// eq. 4.3); absent where one of them does not vary.
    pub correlation: Option<f64>,
    /// The probability of a correlation as far from 0 by chance: two-sided, by Student's t.
    pub correlation_p: Option<f64>,
    /// The correlation within each hunt.
    pub hunt_correlation: Option<Spread>,
    /// The share of hunts in which that is positive with a probability by chance below 0.05.
    pub significant_hunts: f64,
    /// The mean of the levels' departure from the hunt's law of propagation, in dB.
    pub level_mean_db: f64,
    /// The root mean square of that departure, in dB.
    pub level_rms_db: f64,
    /// The factor on σ that fits the errors best, and the floor that is added in squares, in
    /// degrees.
    pub fitted: Option<(f64, f64)>,
}

/// One σ's campaign.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SigmaCampaign {
    /// The σ of the bearings.
    pub setup: SigmaSetup,
    /// The correction that makes it.
    pub calibration: Option<BearingCalibration>,
    /// The estimator's hunts.
    #[serde(flatten)]
    pub campaign: EstimatorCampaign,
}

/// The comparison of the errors with a σ and with the constant one, run by run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SigmaComparison {
    /// The beacon's name.
    pub beacon: String,
    /// The σ whose error is divided by that with the constant one.
    pub setup: SigmaSetup,
    /// The comparison; absent where less than two runs have a fix with both.
    #[serde(flatten)]
    pub paired: Option<Paired>,
}

/// Flies a scenario with each estimator, with the σ of each bearing as the extractor reads it from
/// the pattern, with that σ fitted to the errors, and with a constant σ, otherwise as
/// [`campaign`](super::campaign) does.
///
/// The constant is the root mean square error of the bearings in the estimator's hunts with their
/// own σ, unless `constant_deg` is given: neither has to be guessed, so that the paired test sees
/// nothing but the difference from bearing to bearing. Runs of one number share their seed.
///
/// # Errors
///
/// [`CampaignError`] when the scenario or an estimator cannot be built.
pub fn sigmas_campaign(
    registry: &Registry,
    scenario: &Scenario,
    estimators: &[EstimatorEntry],
    constant_deg: Option<f64>,
    repetition: &Repetition<'_>,
) -> Result<SigmasReport, CampaignError> {
    let runner = Runner::new(repetition.jobs)?;
    let beacons = beacon_names(scenario);
    let mut campaigns = Vec::new();
    for estimator in estimators {
        let fly = |scenario: &Scenario| {
            let hunts = Hunts(Setup { scenario, estimator, registry });
            Ok::<_, SimulationError>(repetition.of(&runner, &hunts)?.into_iter().unzip())
        };
        let (own, heard): (Vec<Flown>, Vec<Heard>) = fly(scenario)?;
        let bearings = statistics(&heard);
        let mut flown = vec![(SigmaSetup::Own, scenario.bearings, own)];
        let before = scenario.bearings.unwrap_or_default();
        if let Some((scale, floor_deg)) = bearings.as_ref().and_then(|found| found.fitted) {
            let fitted = BearingCalibration {
                sigma_scale: scale * before.sigma_scale,
                sigma_floor_deg: floor_deg.hypot(scale * before.sigma_floor_deg),
                ..before
            };
            let (runs, _): (_, Vec<Heard>) = fly(&with_bearings(scenario, fitted))?;
            flown.push((SigmaSetup::Fitted, Some(fitted), runs));
        }
        let constant_deg = constant_deg.or(bearings.as_ref().map(|found| found.rms_deg));
        if let Some(sigma_floor_deg) = constant_deg.filter(|sigma| *sigma > 0.0) {
            let constant = BearingCalibration { sigma_scale: 0.0, sigma_floor_deg, ..before };
            let (runs, _): (_, Vec<Heard>) = fly(&with_bearings(scenario, constant))?;
            flown.push((SigmaSetup::Constant, Some(constant), runs));
        }
        let name = &estimator.name;
        let campaign = |(setup, calibration, runs): &(_, _, Vec<Flown>)| SigmaCampaign {
            setup: *setup,
            calibration: *calibration,
            campaign: summarise(name, &beacons, runs),
        };
        campaigns.push(SigmasCampaign {
            estimator: name.clone().into_owned(),
            bearings,
            setups: flown.iter().map(campaign).collect(),
            comparisons: comparisons(&beacons, &flown),
        });
    }
    Ok(SigmasReport {
        scenario: scenario.name.clone(),
        runs: repetition.runs,
        seed: repetition.seed,
        estimators: campaigns,
    })
}

/// The scenario with another correction of its bearings.
fn with_bearings(scenario: &Scenario, bearings: BearingCalibration) -> Scenario {
    Scenario { bearings: Some(bearings), ..scenario.clone() }
}

/// The errors with each σ over those with the constant one, beacon by beacon.
fn comparisons(
    beacons: &[String],
    flown: &[(SigmaSetup, Option<BearingCalibration>, Vec<Flown>)],
) -> Vec<SigmaComparison> {
    let constant = flown.iter().find(|(setup, ..)| *setup == SigmaSetup::Constant);
    let Some((_, _, constant)) = constant else { return Vec::new() };
    let mut compared = Vec::new();
    for (beacon, name) in beacons.iter().enumerate() {
        for (setup, _, runs) in flown.iter().filter(|(s, ..)| *s != SigmaSetup::Constant) {
            let pairs = runs.iter().zip(constant).filter_map(|(own, other)| {
                Some((own.sample(beacon)?.error_m, other.sample(beacon)?.error_m))
            });
            let paired = Paired::of(pairs);
            compared.push(SigmaComparison { beacon: name.clone(), setup: *setup, paired });
        }
    }
    compared
}

/// Receptions of one hunt against the truth.
#[derive(Clone, Debug, Default)]
struct Heard {
    bearings: Vec<BearingError>,
    without: usize,
    /// Departures of the levels from the model, in dB.
    levels: Vec<f64>,
}

/// Hunts whose receptions are compared with the truth.
struct Hunts<'a>(Setup<'a>);

impl Experiment for Hunts<'_> {
    type Run = (Flown, Heard);
    type Error = SimulationError;

    fn run(&self, seed: u64) -> Result<Self::Run, SimulationError> {
        let Self(setup) = self;
        let beacons = setup.scenario.world.drawn_beacons(seed);
        let model = &setup.scenario.model;
        let law = LogDistance::new(model.reference_dbm, model.exponent).ok();
        let mut heard = Heard::default();
        let flown = setup.simulate(seed, |event| {
            let Event::Received { reception, .. } = event else { return Ok::<_, Infallible>(()) };
            let Some(beacon) = beacons.get(usize::from(reception.beacon.0)) else { return Ok(()) };
            let to = beacon.place_at(reception.time) - reception.receiver.position;
            match &reception.bearing {
                Some(bearing) => heard.bearings.push(BearingError {
                    error: angle::wrap(bearing.angle - to.y.atan2(to.x)),
                    sigma: bearing.sigma,
                }),
                None => heard.without += 1,
            }
            let expected = law.map(|law| law.rss_dbm(to.norm()));
            let level = reception.level.zip(expected);
            heard.levels.extend(level.map(|(level, expected)| level.rss_dbm - expected));
            Ok(())
        });
        Ok((Flown::of(flown)?, heard))
    }
}

/// The statistics of all hunts' bearings.
fn statistics(heard: &[Heard]) -> Option<BearingStatistics> {
    let all = heard.iter().flat_map(|hunt| hunt.bearings.iter().copied());
    let errors: Vec<f64> = all.clone().map(|bearing| bearing.error).collect();
    let sigmas: Vec<f64> = all.clone().map(|bearing| bearing.sigma).collect();
    let levels: Vec<f64> = heard.iter().flat_map(|hunt| hunt.levels.iter().copied()).collect();
    let levels = Spread::of(&levels);
    let of = |hunt: &Heard| Correlation::of(magnitudes(&hunt.bearings));
    let correlations: Vec<Correlation> = heard.iter().filter_map(of).collect();
    let sure = correlations.iter().filter(|r| r.coefficient > 0.0 && r.p_value < 0.05).count();
    let coefficients: Vec<f64> = correlations.iter().map(|found| found.coefficient).collect();
    let every: Vec<BearingError> = all.clone().collect();
    let correlation = Correlation::of(magnitudes(&every));
    let fit = fit_sigma(every.iter().copied()).ok();
    if errors.len() < 3 {
        return None;
    }
    Some(BearingStatistics {
        bearings: errors.len(),
        without: heard.iter().map(|hunt| hunt.without).sum(),
        rms_deg: Spread::of(&errors)?.rms.to_degrees(),
        sigma_deg: Spread::of(&sigmas)?.mean.to_degrees(),
        correlation: correlation.map(|found| found.coefficient),
        correlation_p: correlation.map(|found| found.p_value),
        hunt_correlation: Spread::of(&coefficients),
        significant_hunts: share(sure, correlations.len()),
        level_mean_db: levels.as_ref().map_or(0.0, |levels| levels.mean),
        level_rms_db: levels.as_ref().map_or(0.0, |levels| levels.rms),
        fitted: fit.map(|fit| (fit.scale, fit.floor.to_degrees())),
    })
}

/// σ and the error's magnitude of each bearing.
fn magnitudes(bearings: &[BearingError]) -> impl Iterator<Item = (f64, f64)> + Clone {
    bearings.iter().map(|bearing| (bearing.sigma, bearing.error.abs()))
}

#[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 runs")]
fn share(part: usize, whole: usize) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}
