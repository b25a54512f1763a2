use foxhunt::{
    campaign::OWN,
    registry::{PlannerEntry, Registry},
    scenario::Scenario,
};

use crate::error::CliError;

/// Planner that replaces the scenario's own.
#[derive(Debug, clap::Args)]
pub(super) struct Planning {
    /// The planner (`foxhunt list planners` describes them) [default: the scenario's own]
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

    /// Returns its name, or a note that it is the scenario's own.
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
