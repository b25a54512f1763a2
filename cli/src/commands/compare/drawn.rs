//! Comparisons on drawn bearings and turns, where nothing flies.

use foxhunt::{
    bearing_trial::{
        BearingCampaignError, BearingCase, BearingReport, bearing_campaign, bearing_case_named,
        bearing_cases,
    },
    registry::{EstimatorEntry, ExtractorEntry, antenna_named},
    trial::trial_campaign,
};

use crate::{
    commands::{campaign::tables, choice, settings::Runs},
    error::CliError,
    output::Context,
    table::{number, table},
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
pub struct EstimatorsArgs {
    /// A built-in trial (`foxhunt list trials`) or a TOML file
    trial: String,
    #[command(flatten)]
    runs: Runs,
    /// An estimator; may be repeated [default: the trial's own]
    #[arg(long, value_name = "NAME")]
    estimator: Vec<String>,
}

pub fn run_estimators(args: &EstimatorsArgs, context: Context<'_>) -> Result<(), CliError> {
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

/// Compare extractors on simulated turns of the antenna
///
/// Draws turns with the noise, the losses or the reflection of a case. Every extractor reads the
/// same turns; prints the errors of the bearings, and whether their σ is as large as the errors.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt compare extractors --runs 2000\n  \
                        foxhunt compare extractors bearing-reflector --runs 2000 \
                        --antenna panel.msi")]
pub struct ExtractorsArgs {
    /// The case that turns are drawn from (`foxhunt list cases` describes them)
    #[arg(default_value = DEFAULT_CASE, value_parser = bearing_cases().map(|case| case.name))]
    case: String,
    #[command(flatten)]
    runs: Runs,
    /// An extractor; may be repeated [default: all]
    #[arg(long, value_name = "NAME")]
    extractor: Vec<String>,
    /// The antenna of the turns, also for extractors that take one: reference-patch, isotropic,
    /// dipole, cardioid, patch, yagi, or a file (msi, pln, csv)
    #[arg(long, value_name = "NAME|FILE")]
    antenna: Option<String>,
}

/// Default case.
const DEFAULT_CASE: &str = "bearing-clean";

pub fn run_extractors(args: &ExtractorsArgs, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    let case: BearingCase = bearing_case_named(&args.case)
        .ok_or_else(|| CliError::input(format!("{:?} is not a case", args.case)))?;
    let extractors: Vec<ExtractorEntry> = if args.extractor.is_empty() {
        registry.extractors().to_vec()
    } else {
        let named = |name: &String| registry.extractor(name).cloned();
        args.extractor.iter().map(named).collect::<Result<_, _>>().map_err(CliError::input)?
    };
    let antenna = args.antenna.as_deref().map(antenna_named).unwrap_or_default();
    let report = args.runs.with_progress(output, "turns", 1, |repetition| {
        bearing_campaign(registry, &case, &antenna, &extractors, repetition)
    });
    let report = report.map_err(|error| match error {
        BearingCampaignError::Threads(_) => CliError::failure(error),
        error => CliError::input(error),
    })?;
    output.result(&report, extractor_table)
}

/// Meaning of the columns.
const LEGEND: &str = "Errors and σ in degrees. For a consistent extractor error/σ is 1 in the \
     root mean square, and 95 % of the errors lie within 1.96 σ. r is the correlation \
     of σ and error.";

fn extractor_table(report: &BearingReport) -> String {
    let mut rows = table(&[
        "extractor",
        "rms",
        "median",
        "σ",
        "error/σ",
        "in 95 %",
        "> 4 σ",
        "r",
        "p",
        "level dB",
        "refused",
    ]);
    for e in &report.extractors {
        rows.add_row([
            e.extractor.clone(),
            number(e.rms_deg, 2),
            number(e.median_deg, 2),
            number(e.sigma_deg, 2),
            number(e.sigma_ratio, 2),
            number(e.coverage_95.map(|share| 100.0 * share), 1),
            e.beyond_4_sigma.to_string(),
            number(e.correlation, 2),
            number(e.correlation_p, 3),
            number(e.level_bias_db, 2),
            e.refused.to_string(),
        ]);
    }
    format!(
        "{}, {} turns, seeds from {}; Cramér-Rao bound {:.2}° without \
         reflections\n{rows}\n{LEGEND}",
        report.campaign, report.runs, report.seed, report.bound_deg
    )
}
