//! A scenario as it stands in a file, and the errors of one.

use foxhunt_core::{Quantity, parameter::FieldError};
use foxhunt_sensors::{MagneticDipole, TurnGoal, TurnGoalConfig};
use foxhunt_sim::{BeaconConfig, SimError, VehicleConfig, World, WorldConfig};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::{
    calibration::BearingCalibration,
    config::{
        ExtractorConfig, ExtractorConfigError, ModelConfig, PlannerConfig, Questions, SourceConfig,
    },
    document,
    hunt::{BoxedSource, HuntConfig},
    registry::{EstimatorEntry, Field, HuntParts, Registry, RegistryError},
};

/// A simulated hunt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Name of the scenario.
    pub name: String,
    /// Description in a line.
    pub description: String,
    /// The estimator it flies with unless another one is given.
    pub estimator: String,
    /// The truth: the simulated world.
    pub world: WorldConfig,
    /// Law of propagation that the estimator assumes.
    pub model: ModelConfig,
    /// Extractor of a level and a bearing from a turn.
    pub extractor: ExtractorConfig,
    /// Errors of the bearings and correction of their σ, from a calibration; no correction unless
    /// given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bearings: Option<BearingCalibration>,
    /// Planner that decides where to listen.
    pub planner: PlannerConfig,
    /// Source with which every drone listens; the reference's stepper unless given.
    #[serde(default)]
    pub source: SourceConfig,
    /// Source of each drone, in their order, if they differ.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sources: Vec<SourceConfig>,
    /// Required certainty of a turn's bearings, for which the turn goes on; a turn is one round
    /// unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turns: Option<TurnGoalConfig>,
    /// Time-outs, tolerances, the prior; the defaults of [`HuntConfig`] unless given.
    #[serde(default)]
    pub hunt: HuntConfig,
    /// Settings of the simulation's run; the defaults of [`SimulationConfig`] unless given.
    #[serde(default)]
    pub simulation: SimulationConfig,
}

/// Settings of a simulation's run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimulationConfig {
    /// From one look at the devices to the next, in seconds.
    pub tick_s: f64,
    /// A hunt that takes longer than this, in simulated seconds, has failed.
    pub limit_s: f64,
}

impl Default for SimulationConfig {
    /// A tick of 10 ms, a limit of 4 hours.
    fn default() -> Self {
        Self { tick_s: 0.01, limit_s: 14_400.0 }
    }
}

impl Scenario {
    /// A scenario from TOML; `file` is what errors call it.
    ///
    /// # Errors
    ///
    /// [`ScenarioError`] names the file, the line and the field.
    #[inline]
    pub fn parse(text: &str, file: &str) -> Result<Self, ScenarioError> {
        let mut scenario: Self = document::from_toml(text)
            .map_err(|source| ScenarioError::Parse { file: file.to_owned(), source })?;
        let SimulationConfig { tick_s, limit_s } = scenario.simulation;
        for (field, value, range) in
            [("simulation.tick_s", tick_s, 1e-4..=1.0), ("simulation.limit_s", limit_s, 1.0..=1e7)]
        {
            if !range.contains(&value) {
                let (least, most) = range.into_inner();
                let file = file.to_owned();
                return Err(ScenarioError::Field { file, field, value, least, most });
            }
        }
        if let Some(turns) = &scenario.turns {
            let turning = (0..scenario.world.drones.len().max(1))
                .all(|drone| scenario.source_of(drone).turns());
            let none = FieldError::new("bearing_sigma_deg", turns.bearing_sigma_deg, NO_TURN);
            let checked = scenario.hunt.check_turns(turns);
            checked
                .and(if turning { Ok(()) } else { Err(none) })
                .map_err(|reason| ScenarioError::Turns { file: file.to_owned(), reason })?;
        }
        let there = || {
            let mut terrain = scenario.world.terrain.clone()?;
            terrain.frequency_mhz.get_or_insert(scenario.world.channel.frequency_mhz);
            Some(terrain)
        };
        scenario
            .model
            .resolve_terrain(there)
            .map_err(|reason| ScenarioError::Model { file: file.to_owned(), reason })?;
        let sources = scenario.sources.len();
        let drones = scenario.world.drones.len();
        if sources > 0 && sources != drones {
            let file = file.to_owned();
            return Err(ScenarioError::Sources { file, sources, drones });
        }
        let appears: Vec<f64> = scenario
            .world
            .beacons
            .iter()
            .map(|beacon| beacon.appears_after_s.unwrap_or(0.0))
            .collect();
        if !appears.is_sorted() {
            return Err(ScenarioError::Late { file: file.to_owned() });
        }
        Ok(scenario)
    }

    /// Returns the source with which a drone listens.
    fn source_of(&self, drone: usize) -> &SourceConfig {
        self.sources.get(drone).unwrap_or(&self.source)
    }

    /// Builds what the drones of a world of this scenario listen with, in their order.
    ///
    /// # Errors
    ///
    /// [`SourcesError`] when a number is out of its range, or a name not known.
    pub fn sources(
        &self,
        registry: &Registry,
        world: &World,
    ) -> Result<Vec<BoxedSource>, SourcesError> {
        let goal = self.goal(registry)?;
        let build = |drone: usize| {
            let config = self.source_of(drone);
            if let SourceConfig::Registered { name } = config {
                return Ok(registry.source(name)?.build(world, drone)?);
            }
            let built = config.build(world, drone, goal.as_ref())?;
            built.ok_or_else(|| SourcesError::Kind { kind: config.kind() })
        };
        (0..world.drone_count()).map(build).collect()
    }

    /// Returns the goal of its turns, by its own extractor.
    fn goal(&self, registry: &Registry) -> Result<Option<TurnGoal>, SourcesError> {
        let Some(turns) = self.turns else { return Ok(None) };
        let extractor = registry.build_extractor(&self.extractor)?;
        Ok(Some(TurnGoal::new(turns, extractor.into())?))
    }

    /// Returns the expected number of questions of a turn, `least` at least, for the wanted
    /// bearings of a beacon as far away as the prior's σ; `None` if its turns do not go on, or its
    /// extractor does not know its antenna.
    fn questions_of_goal(&self, source: &SourceConfig, least: u16) -> Option<u16> {
        let (antenna, elevation) = self.extractor.known_antenna()?;
        let goal = TurnGoal::new(self.turns?, self.extractor.build().ok()?.into()).ok()?;
        let ModelConfig { reference_dbm, exponent, .. } = self.model;
        let level = reference_dbm - 10.0 * exponent * libm::log10(self.hunt.prior_sigma_m);
        let floor = source.floor_dbm().or(self.world.channel.floor_dbm);
        let over = floor.map_or(f64::INFINITY, |floor| level - floor);
        Some(goal.expected_questions(&antenna.build().ok()?, elevation, over, (least, MOST)))
    }

    /// Returns the quantities that its sources measure besides level and bearing, each once.
    ///
    /// # Errors
    ///
    /// [`RegistryError`] when the name of a source is not known.
    pub fn quantities(&self, registry: &Registry) -> Result<Vec<Quantity>, RegistryError> {
        let mut quantities = Vec::new();
        for drone in 0..self.world.drones.len() {
            let measured = match self.source_of(drone) {
                SourceConfig::Registered { name } => registry.source(name)?.quantities.as_slice(),
                SourceConfig::ThreeAxis(_) => &MagneticDipole::QUANTITIES,
                SourceConfig::RangeDifference(_) => &[Quantity::RANGE_DIFFERENCE],
                source if source.turns() => &[Quantity::BORESIGHT],
                _ => &[],
            };
            for quantity in measured {
                if !quantities.contains(quantity) {
                    quantities.push(*quantity);
                }
            }
        }
        Ok(quantities)
    }

    /// Returns the field as planners need it.
    #[must_use]
    pub fn field(&self) -> Field {
        let speeds = match &self.world.vehicle {
            VehicleConfig::Kinematic(vehicle) => Some((vehicle.speed_mps, vehicle.climb_mps)),
            VehicleConfig::Quadrotor(vehicle) => Some((vehicle.speed_mps, vehicle.climb_mps)),
            _ => None,
        };
        let beacons = if self.hunt.shared_turns { self.world.beacons.len() } else { 1 };
        let beacons = u16::try_from(beacons).unwrap_or(u16::MAX);
        let sources = match self.sources.as_slice() {
            [] => std::slice::from_ref(&self.source),
            sources => sources,
        };
        let interval = |beacon: &BeaconConfig| Some(beacon.pulses?.interval_s);
        let questions = Questions {
            quickness: self.world.stepper,
            beacons,
            interval_s: self.world.beacons.iter().filter_map(interval).reduce(f64::max),
        };
        let turn = |source: &SourceConfig| {
            source.turn_s(&questions, |least| self.questions_of_goal(source, least))
        };
        let turns = sources.iter().filter_map(turn);
        Field {
            planner: self.planner.clone(),
            exponent: self.model.exponent,
            speed_mps: speeds.map(|(speed, _)| speed),
            climb_mps: speeds.map(|(_, climb)| climb),
            turn_s: turns.reduce(f64::max),
            hunt: self.hunt.clone(),
            drones_m: self
                .world
                .drones
                .iter()
                .map(|drone| Vector3::new(drone.east_m, drone.north_m, drone.up_m))
                .collect(),
        }
    }

    /// Returns the parts of its hunt with an estimator and a seed.
    ///
    /// # Errors
    ///
    /// [`RegistryError`] when the name of a source is not known.
    pub fn parts<'a>(
        &'a self,
        registry: &'a Registry,
        estimator: &'a EstimatorEntry,
        seed: u64,
    ) -> Result<HuntParts<'a>, RegistryError> {
        Ok(HuntParts {
            registry,
            extractor: &self.extractor,
            bearings: self.bearings,
            field: self.field(),
            model: &self.model,
            estimator,
            hunt: &self.hunt,
            beacons: self.beacon_names(),
            quantities: self.quantities(registry)?,
            seed,
        })
    }

    /// The names of the beacons that are there from the beginning, in their order.
    /// Beacons that appear later come after them, and are taken in when they do.
    #[must_use]
    pub fn beacon_names(&self) -> Vec<String> {
        let present = self.world.beacons.iter().filter(|b| b.appears_after_s.is_none());
        present.map(|beacon| beacon.name.clone()).collect()
    }
}

/// The most questions of a turn that are looked ahead to.
const MOST: u16 = 1024;

/// Reason why turns of sources that do not turn have no goal.
const NO_TURN: &str = "left out where a source neither steps nor turns its body";

/// Reason why the sources of a scenario cannot be built.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SourcesError {
    /// A number is out of its range.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// The goal of turns is out of its range.
    #[error("turns: {0}")]
    Turns(#[from] FieldError),
    /// The extractor that turns go by cannot be built.
    #[error(transparent)]
    Extractor(#[from] ExtractorConfigError),
    /// A name is not known.
    #[error("source.name: {0}")]
    Name(#[from] RegistryError),
    /// The kind cannot be simulated.
    #[error("source.kind is \"{kind}\", which cannot be simulated")]
    Kind {
        /// The kind.
        kind: &'static str,
    },
}

/// Reason why there is no scenario.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScenarioError {
    /// There is neither a built-in scenario nor a file of this name.
    #[error(
        "{name:?} is neither a file nor a built-in scenario; choose one of {}",
        known.join(", ")
    )]
    Unknown {
        /// The requested name.
        name: String,
        /// The built-in scenarios.
        known: Vec<String>,
    },
    /// The file cannot be read.
    #[error("{file}: cannot be read")]
    Read {
        /// The file.
        file: String,
        /// Cause of the failure.
        source: std::io::Error,
    },
    /// The file is no scenario; the source names line, field and value.
    #[error("{file}: not a scenario")]
    Parse {
        /// The file.
        file: String,
        /// Error of the parser.
        source: toml::de::Error,
    },
    /// A field is out of its range.
    #[error("{file}: {field} is {value}; it must be in {least} … {most}")]
    Field {
        /// The file.
        file: String,
        /// Name of the field.
        field: &'static str,
        /// Value of the field.
        value: f64,
        /// The least it may be.
        least: f64,
        /// The most it may be.
        most: f64,
    },
    /// There are sources for more drones than there are, or for fewer.
    #[error("{file}: sources lists {sources} for {drones} drones; list one for each, or none")]
    Sources {
        /// The file.
        file: String,
        /// Number of sources.
        sources: usize,
        /// Number of drones.
        drones: usize,
    },
    /// The turns cannot be as they are wanted.
    #[error("{file}: turns: {reason}")]
    Turns {
        /// The file.
        file: String,
        /// Description of the error.
        reason: FieldError,
    },
    /// The model cannot be as it is wanted.
    #[error("{file}: model: {reason}")]
    Model {
        /// The file.
        file: String,
        /// Description of the error.
        reason: FieldError,
    },
    /// A beacon that appears later stands before one that appears earlier.
    #[error("{file}: world.beacons must be in the order in which they appear (appears_after_s)")]
    Late {
        /// The file.
        file: String,
    },
}
