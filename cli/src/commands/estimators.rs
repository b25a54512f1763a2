use foxhunt::{
    config::{NamedEstimator, estimators},
    locate::locate_estimators,
};
use serde::Serialize;

use crate::{error::CliError, output::Output, table::list};

/// List the estimators
///
/// Lists the estimators that `--estimator` takes: the name, what it is, and where it comes from;
/// after those of hunts, which `locate` takes as well, the ones that only `locate` knows. `batch`
/// is another one in `locate`; trials know some of them.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  foxhunt estimators")]
pub(crate) struct Args {}

/// An estimator, as JSON has it.
#[derive(Debug, Serialize)]
struct Listed {
    name: &'static str,
    about: &'static str,
    source: &'static str,
    locate_only: bool,
}

pub(crate) fn run(_: &Args, output: Output) -> Result<(), CliError> {
    let row = |e: NamedEstimator| Listed {
        name: e.name,
        about: e.about,
        source: e.source,
        locate_only: false,
    };
    let mut listed: Vec<_> = estimators().into_iter().map(row).collect();
    listed.extend(locate_estimators().into_iter().map(|e| Listed {
        name: e.estimator.name(),
        about: e.about,
        source: e.source,
        locate_only: true,
    }));
    output.result(&listed, |listed| {
        let mut estimators = list(&["estimator", "what it is", "source"]);
        for e in listed {
            let mark = if e.locate_only { " (locate only)" } else { "" };
            estimators.add_row([&format!("{}{mark}", e.name), e.about, e.source]);
        }
        estimators.to_string()
    })
}
