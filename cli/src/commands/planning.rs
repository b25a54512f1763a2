use foxhunt::{
    campaign::OWN,
    registry::{PlannerEntry, Registry},
    scenario::Scenario,
};

use crate::error::CliError;

/// What decides where the drones listen, if it is not the scenario's own planner.
#[derive(Debug, clap::Args)]
pub(super) struct Planning {
    /// The planner; the scenario's own unless given (`foxhunt list planners` describes them)
    #[arg(long, value_name = "NAME")]
    planner: Option<String>,
}

impl Planning {
    /// The planner of the command line.
    pub(super) fn entry<'a>(
        &self,
        registry: &'a Registry,
    ) -> Result<Option<&'a PlannerEntry>, CliError> {
        let entry = self.planner.as_deref().map(|name| registry.planner(name));
        entry.transpose().map_err(CliError::input)
    }

    /// Its name, or that it is the scenario's own.
    pub(super) fn name(&self) -> &str {
        self.planner.as_deref().unwrap_or(OWN)
    }

    /// Sets the planner of a scenario.
    pub(super) fn apply_to(
        &self,
        scenario: &mut Scenario,
        registry: &Registry,
    ) -> Result<(), CliError> {
        if let Some(planner) = self.entry(registry)? {
            scenario.planner = planner.config(&scenario.field());
        }
        Ok(())
    }
}
