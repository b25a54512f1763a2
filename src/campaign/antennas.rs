use foxhunt_sensors::{BodyConfig, OmnidirectionalConfig, StepperConfig};
use serde::Serialize;

use super::{
    CampaignError, EstimatorCampaign, Paired, Spread,
    run::{Run, durations, fly_all, summarise, threads},
};
use crate::{
    config::{NamedEstimator, SourceConfig},
    scenario::Scenario,
};

/// What a drone listens with, in the question of the reference: is a direction worth its antenna,
/// and a motor worth its weight?
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum AntennaSetup {
    /// An omnidirectional antenna: levels alone.
    Omnidirectional,
    /// A directional antenna that is fixed to the drone, which turns as a whole.
    RotatingBody,
    /// A directional antenna on a stepper.
    RotatingAntenna,
}

impl AntennaSetup {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Omnidirectional, Self::RotatingBody, Self::RotatingAntenna];

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Omnidirectional => "omnidirectional",
            Self::RotatingBody => "rotating-body",
            Self::RotatingAntenna => "rotating-antenna",
        }
    }

    /// The source of every drone: those of the reference (Pritzl 2018, §5.1), of the first one as
    /// many samples as a stepped turn has.
    #[must_use]
    pub fn source(self) -> SourceConfig {
        match self {
            Self::Omnidirectional => {
                SourceConfig::Omnidirectional(OmnidirectionalConfig::default())
            }
            Self::RotatingBody => SourceConfig::RotatingBody(BodyConfig::pritzl2018()),
            Self::RotatingAntenna => SourceConfig::Stepper(StepperConfig::pritzl2018()),
        }
    }
}

/// The same hunts with each antenna.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AntennasReport {
    /// The scenario's name.
    pub scenario: String,
    /// How many hunts each estimator flew with each antenna.
    pub runs: u32,
    /// The seed of the first run; run i has this plus i, with every antenna and estimator.
    pub seed: u64,
    /// The antennas, each with every estimator.
    pub setups: Vec<SetupCampaign>,
    /// Every two antennas, by estimator and beacon.
    pub comparisons: Vec<AntennaComparison>,
}

/// One antenna's campaign.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SetupCampaign {
    /// What the drones listened with.
    pub setup: AntennaSetup,
    /// The estimators, in the order in which they were asked for.
    pub estimators: Vec<EstimatorCampaign>,
    /// How long a hunt took with each of them, in simulated seconds; absent where none came to an
    /// end.
    pub duration_s: Vec<Option<Spread>>,
}

/// How the errors with two antennas compare, run by run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AntennaComparison {
    /// The estimator's name.
    pub estimator: String,
    /// The beacon's name.
    pub beacon: String,
    /// The one whose error is divided.
    pub setup: AntennaSetup,
    /// By this one's.
    pub against: AntennaSetup,
    /// The comparison; absent where less than two runs have a fix with both.
    #[serde(flatten)]
    pub paired: Option<Paired>,
}

/// Flies a scenario `runs` times with each estimator and each antenna, otherwise as
/// [`campaign`](super::campaign) does.
///
/// Runs of one number share their seed, so that beacons, drones and the order of draws are the same
/// with every antenna and errors may be compared run by run.
///
/// # Errors
///
/// [`CampaignError`] when the scenario or an estimator cannot be built.
pub fn antennas_campaign(
    scenario: &Scenario,
    estimators: &[NamedEstimator],
    runs: u32,
    seed: u64,
    jobs: usize,
    progress: &(dyn Fn() + Sync),
) -> Result<AntennasReport, CampaignError> {
    let pool = threads(jobs)?;
    let mut flown = Vec::new();
    for setup in AntennaSetup::ALL {
        let scenario = Scenario { source: setup.source(), sources: Vec::new(), ..scenario.clone() };
        let of = |estimator| fly_all(&pool, &scenario, estimator, runs, seed, progress);
        flown.push((setup, estimators.iter().map(of).collect::<Result<Vec<_>, _>>()?));
    }
    let summary = |(setup, flown): &(AntennaSetup, Vec<Vec<Run>>)| SetupCampaign {
        setup: *setup,
        estimators: estimators
            .iter()
            .zip(flown)
            .map(|(estimator, runs)| summarise(scenario, estimator, runs))
            .collect(),
        duration_s: flown.iter().map(|runs| durations(runs)).collect(),
    };
    let setups = flown.iter().map(summary).collect();
    let mut comparisons = Vec::new();
    for (index, estimator) in estimators.iter().enumerate() {
        for (beacon, config) in scenario.world.beacons.iter().enumerate() {
            for (first, (against, others)) in flown.iter().enumerate() {
                for (setup, own) in flown.iter().skip(first + 1) {
                    let pairs = own[index].iter().zip(&others[index]).filter_map(|(own, other)| {
                        Some((own.sample(beacon)?.error_m, other.sample(beacon)?.error_m))
                    });
                    comparisons.push(AntennaComparison {
                        estimator: estimator.name.to_owned(),
                        beacon: config.name.clone(),
                        setup: *setup,
                        against: *against,
                        paired: Paired::of(pairs),
                    });
                }
            }
        }
    }
    Ok(AntennasReport { scenario: scenario.name.clone(), runs, seed, setups, comparisons })
}
