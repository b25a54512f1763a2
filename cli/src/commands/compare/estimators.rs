use foxhunt::{registry::EstimatorEntry, trial::trial_campaign};

use crate::{
    commands::{campaign_tables::tables, choice, repetition::Runs},
    context::Context,
    error::CliError,
};

/// Compare estimators on drawn bearings
///
/// Draws bearings on a target of known course from a stated density, and prints the errors at the
/// end and at the trial's checkpoints, with the posterior Cramér-Rao bound where there is one.
/// Nothing flies.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt compare estimators isaacs-static --runs 1000\n  \
                        foxhunt compare estimators bot-m --runs 100 --estimator imm \
                        --estimator range-parameterised")]
pub(super) struct Args {
    /// A built-in trial (`foxhunt list trials`) or a TOML file
    trial: String,
    #[command(flatten)]
    runs: Runs,
    /// An estimator; may be repeated [default: the trial's own]
    #[arg(long, value_name = "NAME")]
    estimator: Vec<String>,
}

pub(super) fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    let trial = choice::trial(&args.trial)?;
    let chosen = if args.estimator.is_empty() {
        let place = format!("{}: estimator", args.trial);
        vec![choice::estimator(registry, &trial.estimator, &place)?]
    } else {
        choice::estimators(registry, &args.estimator)?
    };
    let estimators: Vec<EstimatorEntry> = chosen.into_iter().cloned().collect();
    let report = args.runs.with_progress(output, "runs", estimators.len(), |repetition| {
        trial_campaign(&trial, &estimators, repetition)
    });
    output.result(&report.map_err(choice::trial_error)?, tables)
}
