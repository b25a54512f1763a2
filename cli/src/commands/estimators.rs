use foxhunt::{
    config::{NamedEstimator, estimators},
    trial::trial_estimators,
};
use serde::Serialize;

use crate::{error::CliError, output::Output, table::list};

/// List the estimators
///
/// Lists the estimators that `--estimator` takes: the name, what it is, and where it comes from;
/// after those of hunts the ones that only trials know.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  foxhunt estimators")]
pub(crate) struct Args {}

/// An estimator, as JSON has it.
#[derive(Debug, Serialize)]
struct Listed {
    name: &'static str,
    about: &'static str,
    source: &'static str,
    trials_only: bool,
}

pub(crate) fn run(_: &Args, output: Output) -> Result<(), CliError> {
    let row = |e: NamedEstimator| Listed {
        name: e.name,
        about: e.about,
        source: e.source,
        trials_only: false,
    };
    let mut listed: Vec<_> = estimators().into_iter().map(row).collect();
    for e in trial_estimators() {
        if listed.iter().all(|known| known.name != e.name) {
            let (name, about, source) = (e.name, e.about, e.source);
            listed.push(Listed { name, about, source, trials_only: true });
        }
    }
    output.result(&listed, |listed| {
        let mut estimators = list(&["estimator", "what it is", "source"]);
        for e in listed {
            let mark = if e.trials_only { " (trials only)" } else { "" };
            estimators.add_row([&format!("{}{mark}", e.name), e.about, e.source]);
        }
        estimators.to_string()
    })
}
