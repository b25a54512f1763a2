use std::{
    fs::File,
    io::{BufWriter, Write},
    path::PathBuf,
};

use foxhunt::{
    campaign::campaign_watched, document, registry::EstimatorEntry, report::HuntReport,
    scenario::DEFAULT_SCENARIO, trial::builtin_trials,
};

use super::{
    campaign_tables::tables, choice, planning::Planning, repetition::Runs, settings::Settings,
};
use crate::{
    context::Context,
    error::CliError,
    output::{event, warn},
};

/// Fly a hunt many times and compare estimators
///
/// Flies the same scenario again and again, each run with the next seed and each estimator on the
/// same seeds. Prints the distribution of the errors, the steps and the time until the 95 %
/// ellipse's semi-major axis is below 3 m, and whether the estimators are consistent.
///
/// With --store every run is kept in a file. The same command again flies only what is missing in
/// it and prints the table of the whole; `foxhunt results` works on the file.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt campaign --runs 100\n  \
                        foxhunt campaign pritzl-6.1 --runs 1000 --estimator ukf-pritzl2018 \
                        --estimator ekf-pritzl2018\n  \
                        foxhunt campaign far-start --runs 100 --planner information\n  \
                        foxhunt campaign --runs 100000 --store runs.sqlite\n\n\
                        Other comparisons: foxhunt compare --help")]
pub(crate) struct Args {
    /// A built-in scenario (`foxhunt list scenarios`) or a TOML file
    #[arg(default_value = DEFAULT_SCENARIO)]
    scenario: String,
    #[command(flatten)]
    runs: Runs,
    /// Write the result of every hunt to this file, one JSON value per line; hunts that could not
    /// go on have no line
    #[arg(long, value_name = "FILE")]
    hunts_to: Option<PathBuf>,
    /// An estimator; may be repeated [default: the scenario's own]
    #[arg(long, value_name = "NAME")]
    estimator: Vec<String>,
    #[command(flatten)]
    planning: Planning,
    #[command(flatten)]
    settings: Settings,
    #[cfg(feature = "store")]
    #[command(flatten)]
    storing: super::storing::Storing,
}

pub(crate) fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    let mut scenario = choice::scenario(&args.scenario)?;
    args.settings.apply_to(&mut scenario, registry)?;
    args.planning.apply_to(&mut scenario, registry)?;
    let chosen = choice::estimators_of(registry, &args.estimator, &scenario, &args.scenario)?;
    let estimators: Vec<EstimatorEntry> =
        chosen.into_iter().map(|entry| args.settings.estimator(entry)).collect::<Result<_, _>>()?;
    if is_trial(&args.scenario) {
        warn(&format!(
            "{0} is flown; `foxhunt compare estimators {0}` draws the bearings of the trial",
            args.scenario
        ));
    }
    #[cfg(feature = "store")]
    if let Some(into) = args.storing.job(registry, &scenario, &estimators, args.planning.name())? {
        let report = args.runs.with_progress_of(
            output,
            "hunts",
            estimators.len(),
            into.part_of(args.runs.count()),
            |repetition| into.fly(repetition),
        );
        return output
            .result(&report.map_err(|e| super::storing::error(e, &args.scenario))?, tables);
    }
    let path = args.hunts_to.as_deref();
    let file = path.map(|path| File::create(path).map_err(|error| CliError::writing(path, error)));
    let mut file = file.transpose()?.map(BufWriter::new);
    let report = args.runs.with_progress(output, "hunts", estimators.len(), |repetition| {
        campaign_watched(registry, &scenario, &estimators, repetition, |hunt| {
            let hunt = HuntReport { planner: args.planning.name().to_owned(), ..hunt.clone() };
            if output.streams() {
                event("hunt", &hunt)?;
            }
            let Some(file) = &mut file else { return Ok(()) };
            document::write_json(&mut *file, &hunt)?;
            file.write_all(b"\n")
        })
    });
    let mut report = report.map_err(|error| choice::campaign_error(error, &args.scenario))?;
    if let (Some(file), Some(path)) = (&mut file, path) {
        file.flush().map_err(|error| CliError::writing(path, error))?;
    }
    report.planner = Some(args.planning.name().to_owned());
    output.result(&report, tables)
}

/// Returns true if a built-in trial has the name of a scenario.
fn is_trial(name: &str) -> bool {
    builtin_trials().iter().any(|trial| trial.name == name)
}
