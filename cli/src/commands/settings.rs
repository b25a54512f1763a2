use clap::ValueEnum;
use foxhunt::{
    registry::{EstimatorEntry, Registry, RegistryError},
    scenario::Scenario,
    sim::{Dynamics, VehicleConfig},
};

use super::{calibration::Calibration, extraction::Extraction, overrides::Overrides};
use crate::error::CliError;

/// Settings that replace a scenario's own, besides the planner.
#[derive(Debug, clap::Args)]
pub(super) struct Settings {
    /// The source that all drones listen with (`foxhunt list sources`) [default: the scenario's
    /// own]
    #[arg(long, value_name = "NAME")]
    source: Option<String>,
    /// The equations of motion of a scenario's quadrotors [default: the scenario's own]
    #[arg(long, value_name = "NAME")]
    dynamics: Option<QuadrotorDynamics>,
    #[command(flatten)]
    extraction: Extraction,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    calibration: Calibration,
}

/// The dynamics of quadrotors on the command line.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum QuadrotorDynamics {
    /// The simplified body of Isaacs et al. 2014, eq. 3 to 8
    Isaacs2014,
    /// The full rigid body of eq. 1 and 2
    RigidBody,
}

impl Settings {
    /// Sets source, dynamics, calibration, bearings and extractor of a scenario.
    pub(super) fn apply_to(
        &self,
        scenario: &mut Scenario,
        registry: &Registry,
    ) -> Result<(), CliError> {
        self.apply_source_to(scenario, registry)?;
        self.apply_dynamics_to(scenario)?;
        self.calibration.read()?.apply_to(scenario);
        self.overrides.apply_to(scenario);
        scenario.extractor = self.extraction.config(registry, &scenario.extractor)?;
        self.overrides.warn_of_turned_patterns(scenario);
        Ok(())
    }

    /// Sets the source of all drones of a scenario.
    fn apply_source_to(
        &self,
        scenario: &mut Scenario,
        registry: &Registry,
    ) -> Result<(), CliError> {
        let Some(name) = &self.source else { return Ok(()) };
        let refused = |why: RegistryError| CliError::input(format!("--source: {why}"));
        let source = registry.source_config(name, &scenario.source, &scenario.model);
        let source = source.map_err(refused)?;
        if scenario.turns.is_some() && !source.turns() {
            return Err(CliError::input(format!(
                "--source {name}: [turns] of {} has a goal for turns, and this source does not \
                 turn",
                scenario.name
            )));
        }
        scenario.source = source;
        scenario.sources.clear();
        Ok(())
    }

    /// Sets the dynamics of a scenario's quadrotors.
    fn apply_dynamics_to(&self, scenario: &mut Scenario) -> Result<(), CliError> {
        let Some(dynamics) = self.dynamics else { return Ok(()) };
        let VehicleConfig::Quadrotor(vehicle) = &mut scenario.world.vehicle else {
            return Err(CliError::input(format!(
                "--dynamics: the drones of {} are no quadrotors; [world.vehicle] needs kind = \
                 \"quadrotor\"",
                scenario.name
            )));
        };
        match dynamics {
            QuadrotorDynamics::Isaacs2014 => {
                vehicle.dynamics = Dynamics::Isaacs2014;
                vehicle.inertia_kg_m2 = None;
            }
            QuadrotorDynamics::RigidBody => vehicle.dynamics = Dynamics::RigidBody,
        }
        Ok(())
    }

    /// The estimator with the settings of the command line.
    pub(super) fn estimator(&self, entry: &EstimatorEntry) -> Result<EstimatorEntry, CliError> {
        self.overrides.estimator(entry)
    }
}
