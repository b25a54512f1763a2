//! Comparisons of contenders on the same seeds.

mod drawn;
mod flown;
mod planners;

use crate::{error::CliError, output::Context};

/// Compare estimators, extractors, antennas, planners or the σ of bearings
///
/// Runs every contender on the same seeds. `foxhunt campaign` compares estimators in flown hunts;
/// `compare estimators` uses drawn bearings, which is much faster.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
                        foxhunt compare estimators isaacs-static --runs 1000\n  \
                        foxhunt compare extractors bearing-reflector --runs 2000\n  \
                        foxhunt compare antennas --runs 200 --estimator grid\n  \
                        foxhunt compare planners --runs 100 --estimator grid\n  \
                        foxhunt compare sigmas pritzl-7.2 --runs 500 --estimator ukf")]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

/// Kind of contenders.
#[derive(Debug, clap::Subcommand)]
enum What {
    Estimators(drawn::EstimatorsArgs),
    Extractors(drawn::ExtractorsArgs),
    Antennas(flown::AntennasArgs),
    Planners(planners::Args),
    Sigmas(flown::SigmasArgs),
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    match &args.what {
        What::Estimators(args) => drawn::run_estimators(args, context),
        What::Extractors(args) => drawn::run_extractors(args, context),
        What::Antennas(args) => flown::run_antennas(args, context),
        What::Planners(args) => planners::run(args, context),
        What::Sigmas(args) => flown::run_sigmas(args, context),
    }
}
