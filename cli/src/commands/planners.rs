use foxhunt::config::{NamedPlanner, planners};
use serde::Serialize;

use crate::{error::CliError, output::Output, table::list};

/// List the planners
///
/// Lists what decides where the drones listen next, as `--planner` takes it: the name, what it is,
/// and where it comes from. A scenario's file may set each of them otherwise.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  foxhunt planners")]
pub(crate) struct Args {}

/// A planner, as JSON has it.
#[derive(Debug, Serialize)]
struct Listed {
    name: &'static str,
    about: &'static str,
    source: &'static str,
}

pub(crate) fn run(_: &Args, output: Output) -> Result<(), CliError> {
    let row = |NamedPlanner { name, about, source, .. }| Listed { name, about, source };
    let listed: Vec<_> = planners().into_iter().map(row).collect();
    output.result(&listed, |listed| {
        let mut rows = list(&["planner", "what it is", "source"]);
        for planner in listed {
            rows.add_row([planner.name, planner.about, planner.source]);
        }
        rows.to_string()
    })
}
