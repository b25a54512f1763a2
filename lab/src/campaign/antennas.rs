use foxhunt_sensors::{BodyConfig, OmnidirectionalConfig, StepperConfig};
use serde::Serialize;

use foxhunt_hunt::{
    config::SourceConfig,
    registry::{EstimatorEntry, Registry},
    scenario::Scenario,
};

use super::{
    CampaignError, EstimatorCampaign, Repetition,
    run::{Flights, Flown, beacon_names, durations, simulate, summarise},
};
use crate::{Paired, Runner, Spread, simulation::Setup};

/// The antenna that a drone listens with, in the question of the reference: is a direction worth
/// its antenna, and a motor worth its weight?
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

    /// The source of every drone, as in the reference (Pritzl 2018, §5.1); an omnidirectional one
    /// takes as many samples as a stepped turn has.
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

/// A scenario's hunts with each antenna.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AntennasReport {
    /// The scenario's name.
    pub scenario: String,
    /// The number of hunts that each estimator flew with each antenna.
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
    /// The antenna that the drones listened with.
    pub setup: AntennaSetup,
    /// The estimators, in the order of the call.
    pub estimators: Vec<EstimatorCampaign>,
    /// The duration of a hunt with each of them, in simulated seconds; absent if no hunt ended.
    pub duration_s: Vec<Option<Spread>>,
}

/// The comparison of the errors with two antennas, run by run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AntennaComparison {
    /// The estimator's name.
    pub estimator: String,
    /// The beacon's name.
    pub beacon: String,
    /// The antenna whose error is divided.
    pub setup: AntennaSetup,
    /// The antenna whose error is the divisor.
    pub against: AntennaSetup,
    /// The comparison; absent where less than two runs have a fix with both.
    #[serde(flatten)]
    pub paired: Option<Paired>,
}

/// Flies a scenario with each estimator and each antenna, otherwise as
/// [`campaign`](super::campaign) does.
///
/// Runs of one number share their seed, so that beacons, drones and the order of draws are the same
/// with every antenna and errors may be compared run by run.
///
/// # Errors
///
/// [`CampaignError`] when the scenario or an estimator cannot be built.
pub fn antennas_campaign(
    registry: &Registry,
    scenario: &Scenario,
    estimators: &[EstimatorEntry],
    repetition: &Repetition<'_>,
) -> Result<AntennasReport, CampaignError> {
    let runner = Runner::new(repetition.jobs)?;
    let mut flown = Vec::new();
    for antenna in AntennaSetup::ALL {
        let scenario =
            &Scenario { source: antenna.source(), sources: Vec::new(), ..scenario.clone() };
        let of = |estimator| {
            let setup = Setup { scenario, estimator, registry };
            repetition.of(&runner, &Flights(|seed| simulate(&setup, seed)))
        };
        flown.push((antenna, estimators.iter().map(of).collect::<Result<Vec<_>, _>>()?));
    }
    let beacons = beacon_names(scenario);
    let summary = |(setup, flown): &(AntennaSetup, Vec<Vec<Flown>>)| SetupCampaign {
        setup: *setup,
        estimators: estimators
            .iter()
            .zip(flown)
            .map(|(estimator, runs)| summarise(&estimator.name, &beacons, runs))
            .collect(),
        duration_s: flown.iter().map(|runs| durations(runs)).collect(),
    };
    let setups = flown.iter().map(summary).collect();
    let mut comparisons = Vec::new();
    for (index, estimator) in estimators.iter().enumerate() {
        for (beacon, name) in beacons.iter().enumerate() {
            for (first, (against, others)) in flown.iter().enumerate() {
                for (setup, own) in flown.iter().skip(first + 1) {
                    let pairs = own[index].iter().zip(&others[index]).filter_map(|(own, other)| {
                        Some((own.sample(beacon)?.error_m, other.sample(beacon)?.error_m))
                    });
                    comparisons.push(AntennaComparison {
                        estimator: estimator.name.clone().into_owned(),
                        beacon: name.clone(),
                        setup: *setup,
                        against: *against,
                        paired: Paired::of(pairs),
                    });
                }
            }
        }
    }
    Ok(AntennasReport {
        scenario: scenario.name.clone(),
        runs: repetition.runs,
        seed: repetition.seed,
        setups,
        comparisons,
    })
}
