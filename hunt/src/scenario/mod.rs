//! Simulated hunts as files: what is true, what the hunt takes for known, and its parts.

mod builtin;
mod calibrated;
mod error;
mod random_fleet;

pub use builtin::{DEFAULT_SCENARIO, builtin_scenarios};
pub use error::ScenarioError;
pub use random_fleet::random_fleet;

use std::{fs, path::Path};

use foxhunt_core::Quantity;
use foxhunt_sensors::MagneticDipole;
use foxhunt_sim::{SimError, VehicleConfig, World, WorldConfig};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::{
    calibration::BearingCalibration,
    config::{ExtractorConfig, ModelConfig, PlannerConfig, SourceConfig},
    hunt::{BoxedSource, HuntConfig},
    registry::{EstimatorEntry, Field, HuntParts, Registry, RegistryError},
};

/// A simulated hunt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Its name.
    pub name: String,
    /// What it is, in a line.
    pub description: String,
    /// The estimator it flies with unless another one is given.
    pub estimator: String,
    /// What is true.
    pub world: WorldConfig,
    /// What the estimator takes for the law of propagation.
    pub model: ModelConfig,
    /// What makes a level and a bearing of a turn.
    pub extractor: ExtractorConfig,
    /// How the bearings err and their σ is off, as a calibration has it; as they are unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bearings: Option<BearingCalibration>,
    /// What decides where to listen.
    pub planner: PlannerConfig,
    /// What every drone listens with; the reference's stepper unless given.
    #[serde(default)]
    pub source: SourceConfig,
    /// What each drone listens with, in their order, where they differ.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sources: Vec<SourceConfig>,
    /// Time-outs, tolerances, the prior; the defaults of [`HuntConfig`] unless given.
    #[serde(default)]
    pub hunt: HuntConfig,
    /// How the simulation runs; the defaults of [`SimulationConfig`] unless given.
    #[serde(default)]
    pub simulation: SimulationConfig,
}

/// How a simulation runs.
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
    /// The scenario of a built-in name or of a [`random_fleet`], or else of a TOML file.
    ///
    /// # Errors
    ///
    /// [`ScenarioError`] names the file, the line and the field.
    pub fn find(name_or_path: &str) -> Result<Self, ScenarioError> {
        if let Some(text) = builtin::text_of(name_or_path) {
            return Self::parse(text, name_or_path);
        }
        if let Some(seed) = random_fleet::seed_in(name_or_path) {
            return Ok(random_fleet(seed));
        }
        let path = Path::new(name_or_path);
        if !path.exists() {
            let known = builtin_scenarios().into_iter().map(|s| s.name).collect();
            return Err(ScenarioError::Unknown { name: name_or_path.to_owned(), known });
        }
        let text = fs::read_to_string(path)
            .map_err(|source| ScenarioError::Read { file: name_or_path.to_owned(), source })?;
        Self::parse(&text, name_or_path)
    }

    /// A scenario from TOML; `file` is what errors call it.
    ///
    /// # Errors
    ///
    /// [`ScenarioError`] names the file, the line and the field.
    pub fn parse(text: &str, file: &str) -> Result<Self, ScenarioError> {
        let scenario: Self = toml::from_str(text)
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
        let (sources, drones) = (scenario.sources.len(), scenario.world.drones.len());
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

    /// What a drone listens with.
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
        let build = |drone: usize| {
            let config = self.source_of(drone);
            if let SourceConfig::Registered { name } = config {
                return Ok(registry.source(name)?.build(world, drone)?);
            }
            let built = config.build(world, drone)?;
            built.ok_or_else(|| SourcesError::Kind { kind: format!("{config:?}") })
        };
        (0..world.drone_count()).map(build).collect()
    }

    /// What its sources measure besides level and bearing.
    ///
    /// # Errors
    ///
    /// [`RegistryError`] when the name of a source is not known.
    pub fn quantities(&self, registry: &Registry) -> Result<Vec<Quantity>, RegistryError> {
        let mut quantities = Vec::new();
        for drone in 0..self.world.drones.len() {
            match self.source_of(drone) {
                SourceConfig::Registered { name } => {
                    quantities.extend_from_slice(&registry.source(name)?.quantities);
                }
                SourceConfig::ThreeAxis(_) => quantities.extend(MagneticDipole::QUANTITIES),
                _ => {}
            }
        }
        Ok(quantities)
    }

    /// What planners need to know of it.
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
        let turns = sources.iter().filter_map(|s| s.turn_s(&self.world.stepper, beacons));
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

    /// What its hunt is made of with an estimator and a seed.
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

    /// The names of the beacons that are there from the beginning, in their order. Those that
    /// appear later come after them, and are taken in when they do.
    #[must_use]
    pub fn beacon_names(&self) -> Vec<String> {
        let present = self.world.beacons.iter().filter(|b| b.appears_after_s.is_none());
        present.map(|beacon| beacon.name.clone()).collect()
    }
}

/// Why the sources of a scenario cannot be built.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SourcesError {
    /// A number is out of its range.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// A name is not known.
    #[error("source.name: {0}")]
    Name(#[from] RegistryError),
    /// The kind cannot be simulated.
    #[error("source {kind} cannot be simulated")]
    Kind {
        /// The source.
        kind: String,
    },
}
