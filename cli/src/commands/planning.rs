use clap::builder::PossibleValuesParser;
use foxhunt::{
    campaign::OWN,
    config::{NamedPlanner, planner_named, planners},
    scenario::Scenario,
};

use crate::error::CliError;

/// What decides where the drones listen, where it is not the scenario's own planner.
#[derive(Debug, clap::Args)]
pub(super) struct Planning {
    /// The planner; the scenario's own unless given (`foxhunt planners` explains them)
    #[arg(long, value_name = "NAME", value_parser = planner_parser())]
    planner: Option<String>,
}

impl Planning {
    /// Whether one was asked for.
    pub(super) fn is_given(&self) -> bool {
        self.planner.is_some()
    }

    /// Those to be compared: the reference's and the one that was asked for, or else all.
    pub(super) fn compared(&self) -> Vec<NamedPlanner> {
        let mut known = planners();
        if let Some(asked) = &self.planner {
            known.retain(|planner| planner.name == asked || planner.name == REFERENCE);
        }
        known.sort_by_key(|planner| planner.name != REFERENCE);
        known
    }

    /// The one that was asked for.
    pub(super) fn named(&self) -> Option<NamedPlanner> {
        self.planner.as_deref().and_then(planner_named)
    }

    /// Its name, or that it is the scenario's own.
    pub(super) fn name(&self) -> &str {
        self.planner.as_deref().unwrap_or(OWN)
    }

    /// Has the scenario flown by the planner that was asked for.
    pub(super) fn tell(&self, scenario: &mut Scenario) -> Result<(), CliError> {
        if let Some(name) = &self.planner {
            let planner = planner_named(name)
                .ok_or_else(|| CliError::input(format!("--planner is {name:?}, no planner")))?;
            scenario.planner = planner.config(scenario);
        }
        Ok(())
    }
}

/// The planner that others are compared with.
const REFERENCE: &str = "pritzl2018";

/// Takes the name of a planner; what is unknown is refused with the names that are known.
fn planner_parser() -> PossibleValuesParser {
    PossibleValuesParser::new(planners().into_iter().map(|known| known.name))
}
