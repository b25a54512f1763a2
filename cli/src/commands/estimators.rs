use foxhunt::config::{NamedEstimator, estimators};
use serde::Serialize;

use crate::{error::CliError, output::Output, table::list};

/// List the estimators
///
/// Lists the estimators that `--estimator` takes: the name, what it is, and where it comes from.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  foxhunt estimators")]
pub(crate) struct Args {}

/// An estimator, as JSON has it.
#[derive(Debug, Serialize)]
struct Listed {
    name: &'static str,
    about: &'static str,
    source: &'static str,
}

pub(crate) fn run(_: &Args, output: Output) -> Result<(), CliError> {
    let row = |e: NamedEstimator| Listed { name: e.name, about: e.about, source: e.source };
    let listed: Vec<_> = estimators().into_iter().map(row).collect();
    output.result(&listed, |listed| {
        let mut estimators = list(&["estimator", "what it is", "source"]);
        for e in listed {
            estimators.add_row([e.name, e.about, e.source]);
        }
        estimators.to_string()
    })
}
