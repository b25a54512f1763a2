//! Antennas and planners, each compared on the same hunts.

use foxhunt_core::Outcome;
use foxhunt_hunt::{
    config::SourceConfig,
    registry::{EstimatorEntry, PlannerEntry, Registry},
    scenario::Scenario,
};
use foxhunt_sensors::{BodyConfig, OmnidirectionalConfig, StepperConfig};
use serde::Serialize;

use super::{
    BeaconCampaign, CampaignError, EstimatorCampaign, Flights, Flown, Repetition, beacon_names,
    durations, simulate, summarise,
};
use crate::{
    Paired, Runner, Spread,
    simulation::{SearchProgress, Setup},
};

/// The built-in scenarios in which planners are compared: near, far, several beacons in shared
/// turns, and one drone alone.
pub const PLANNER_SCENARIOS: [&str; 4] = ["pritzl-6.1", "far-start", "three-beacons", "one-drone"];

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

    /// Returns the name of the antenna setup.
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

/// A scenario's hunts with each planner.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlannersReport {
    /// The scenario's name.
    pub scenario: String,
    /// The estimator's name, the same for every planner.
    pub estimator: String,
    /// The number of hunts that each planner flew.
    pub runs: u32,
    /// The seed of the first run; run i has this plus i, with every planner.
    pub seed: u64,
    /// The planners, in the order of the call.
    pub planners: Vec<PlannerCampaign>,
    /// Every planner but the first against the first, by beacon.
    pub comparisons: Vec<PlannerComparison>,
}

/// One planner's campaign.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlannerCampaign {
    /// The planner's name.
    pub planner: String,
    /// The duration of a hunt in simulated seconds; absent if no hunt ended.
    pub duration_s: Option<Spread>,
    /// The beacons, in their order.
    pub beacons: Vec<PlannedBeacon>,
}

/// One planner on one beacon over all runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlannedBeacon {
    /// The figures that every campaign has.
    #[serde(flatten)]
    pub figures: BeaconCampaign,
    /// The ends of the searches, the most frequent first; hunts that could not go on are not
    /// counted.
    pub outcomes: Vec<OutcomeCount>,
}

/// The number of runs in which a search ended in one way.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OutcomeCount {
    /// The end of the search.
    pub outcome: Outcome,
    /// The number of runs.
    pub runs: u32,
}

impl OutcomeCount {
    /// Counts ends, the most frequent one first.
    pub(super) fn of(outcomes: impl IntoIterator<Item = Outcome>) -> Vec<Self> {
        let mut counts: Vec<Self> = Vec::new();
        for outcome in outcomes {
            match counts.iter_mut().find(|count| count.outcome == outcome) {
                Some(count) => count.runs += 1,
                None => counts.push(Self { outcome, runs: 1 }),
            }
        }
        counts.sort_by_key(|count| std::cmp::Reverse(count.runs));
        counts
    }
}

/// The comparison of two planners run by run: the ratios of the first one's figures over the second
/// one's. A figure is absent where less than two runs have it with both; runs in which one of them
/// never got to 3 m have no ratio to compare, and `never` counts them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlannerComparison {
    /// The beacon's name.
    pub beacon: String,
    /// The planner whose figures are divided.
    pub planner: String,
    /// The planner whose figures are the divisors.
    pub against: String,
    /// Steps until the 95 % ellipse's semi-major axis is below 3 m.
    pub steps_to_3m: Option<Paired>,
    /// Simulated seconds until then.
    pub time_to_3m_s: Option<Paired>,
    /// Metres that all drones flew.
    pub path_m: Option<Paired>,
    /// Metres from the estimate to the truth.
    pub error_m: Option<Paired>,
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

/// Flies a scenario with each planner, otherwise as [`campaign`](super::campaign) does.
///
/// Runs of one number share their seed, so that beacons, drones and what belongs to places are the
/// same with every planner; what a drone draws at a place is not, as they fly elsewhere.
///
/// # Errors
///
/// [`CampaignError`] when the scenario, the estimator or a planner cannot be built.
pub fn planners_campaign(
    registry: &Registry,
    scenario: &Scenario,
    estimator: &EstimatorEntry,
    planners: &[PlannerEntry],
    repetition: &Repetition<'_>,
) -> Result<PlannersReport, CampaignError> {
    let runner = Runner::new(repetition.jobs)?;
    let field = scenario.field();
    let mut flown: Vec<(&PlannerEntry, Vec<Flown>)> = Vec::new();
    for planner in planners {
        let scenario = &Scenario { planner: planner.config(&field), ..scenario.clone() };
        let setup = Setup { scenario, estimator, registry };
        flown.push((planner, repetition.of(&runner, &Flights(|seed| simulate(&setup, seed)))?));
    }
    let beacons = beacon_names(scenario);
    let mut comparisons = Vec::new();
    if let Some(((against, theirs), others)) = flown.split_first() {
        for (index, beacon) in beacons.iter().enumerate() {
            for (planner, own) in others {
                let runs = || own.iter().zip(theirs);
                let progress = |figure: fn(&SearchProgress) -> Option<f64>| {
                    let of = move |run: &Flown| figure(&run.progress(index)?);
                    Paired::of(runs().filter_map(|(own, other)| Some((of(own)?, of(other)?))))
                };
                let errors = runs().filter_map(|(own, other)| {
                    Some((own.sample(index)?.error_m, other.sample(index)?.error_m))
                });
                comparisons.push(PlannerComparison {
                    beacon: beacon.clone(),
                    planner: planner.name.clone().into_owned(),
                    against: against.name.clone().into_owned(),
                    steps_to_3m: progress(|search| search.steps_to_3m.map(f64::from)),
                    time_to_3m_s: progress(|search| search.time_to_3m_s),
                    path_m: progress(|search| Some(search.path_m)),
                    error_m: Paired::of(errors),
                });
            }
        }
    }
    let planners = flown.iter().map(|(planner, flown)| {
        let figures = summarise(&estimator.name, &beacons, flown).beacons;
        let beacon = |(index, figures)| {
            let outcomes = flown.iter().filter_map(|run| run.outcome(index));
            PlannedBeacon { figures, outcomes: OutcomeCount::of(outcomes) }
        };
        PlannerCampaign {
            planner: planner.name.clone().into_owned(),
            duration_s: durations(flown),
            beacons: figures.into_iter().enumerate().map(beacon).collect(),
        }
    });
    Ok(PlannersReport {
        scenario: scenario.name.clone(),
        estimator: estimator.name.clone().into_owned(),
        runs: repetition.runs,
        seed: repetition.seed,
        planners: planners.collect(),
        comparisons,
    })
}
