use foxhunt::scenario::{DEFAULT_SCENARIO, builtin_scenarios};
use serde::Serialize;

use crate::{error::CliError, output::Output, table::list};

/// List the built-in scenarios
///
/// Lists the simulated hunts that need no file: for `foxhunt hunt` and `foxhunt campaign`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  foxhunt scenarios")]
pub(crate) struct Args {}

/// A scenario, as JSON has it.
#[derive(Debug, Serialize)]
struct Listed {
    name: String,
    description: String,
    estimator: String,
    drones: usize,
    beacons: usize,
    default: bool,
}

pub(crate) fn run(_: &Args, output: Output) -> Result<(), CliError> {
    let listed: Vec<_> = builtin_scenarios()
        .into_iter()
        .map(|scenario| Listed {
            default: scenario.name == DEFAULT_SCENARIO,
            drones: scenario.world.drones.len(),
            beacons: scenario.world.beacons.len(),
            name: scenario.name,
            description: scenario.description,
            estimator: scenario.estimator,
        })
        .collect();
    output.result(&listed, |listed| {
        let mut scenarios = list(&["scenario", "drones", "beacons", "estimator", "what it is"]);
        for s in listed {
            let mark = if s.default { " (default)" } else { "" };
            scenarios.add_row([
                format!("{}{mark}", s.name),
                s.drones.to_string(),
                s.beacons.to_string(),
                s.estimator.clone(),
                s.description.clone(),
            ]);
        }
        scenarios.to_string()
    })
}
