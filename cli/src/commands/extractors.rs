use foxhunt::config::{NamedExtractor, RECOMMENDED_EXTRACTOR, extractors};
use serde::Serialize;

use crate::{output::Output, table::list};

/// List the extractors of bearings
///
/// Lists what makes a level and a bearing of a turn of the antenna, as `--extractor` takes it: the
/// name, what it is, and where it comes from. `foxhunt campaign bearing-clean` and its like compare
/// them.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  foxhunt extractors")]
pub(crate) struct Args {}

/// An extractor, as JSON has it.
#[derive(Debug, Serialize)]
struct Listed {
    name: &'static str,
    about: &'static str,
    source: &'static str,
    /// Whether it wants to be told the antenna.
    needs_antenna: bool,
    recommended: bool,
}

pub(crate) fn run(_: &Args, output: Output) -> Result<(), crate::error::CliError> {
    let row = |NamedExtractor { name, about, source, config }| Listed {
        name,
        about,
        source,
        needs_antenna: config.with_antenna(&Default::default()).is_some(),
        recommended: name == RECOMMENDED_EXTRACTOR,
    };
    let listed: Vec<_> = extractors().into_iter().map(row).collect();
    output.result(&listed, |listed| {
        let mut rows = list(&["extractor", "what it is", "source"]);
        for e in listed {
            rows.add_row([e.name, e.about, e.source]);
        }
        format!("{rows}\nWhere the antenna is known, {RECOMMENDED_EXTRACTOR} is the best.")
    })
}
