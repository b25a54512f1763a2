use foxhunt::{
    scenario::{DEFAULT_SCENARIO, builtin_scenarios},
    trial::builtin_trials,
};
use serde::Serialize;

use crate::{error::CliError, output::Output, table::list};

/// List the built-in scenarios
///
/// Lists the simulated hunts that need no file: for `foxhunt hunt` and `foxhunt campaign`; and the
/// trials, in which nothing flies and bearings are drawn: for `foxhunt campaign`.
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
    trial: bool,
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
            trial: false,
        })
        .chain(builtin_trials().into_iter().map(|trial| Listed {
            default: false,
            drones: 1,
            beacons: 1,
            name: trial.name,
            description: trial.description,
            estimator: trial.estimator,
            trial: true,
        }))
        .collect();
    output.result(&listed, |listed| {
        let mut scenarios = list(&["scenario", "drones", "beacons", "estimator", "what it is"]);
        for s in listed {
            let mark = match (s.default, s.trial) {
                (true, _) => " (default)",
                (_, true) => " (trial)",
                _ => "",
            };
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
