use foxhunt::{
    Spread,
    campaign::{SigmaSetup, SigmasReport, sigmas_campaign},
};

use super::flown::Flown;
use crate::{
    context::Context,
    error::CliError,
    table::{number, table, text},
};

/// Compare the σ of bearings in flown hunts
///
/// Flies a scenario with the σ that the extractor reads from each pattern, with that σ scaled to
/// the size of the errors, and with a constant σ, and compares the errors run by run. Prints the
/// correlation of σ with the errors of the bearings as well.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  foxhunt compare sigmas pritzl-7.2 --runs 500 --estimator ukf")]
pub(super) struct Args {
    #[command(flatten)]
    flown: Flown,
    /// The constant σ in degrees [default: the root mean square error of the bearings]
    #[arg(long, value_name = "DEG")]
    constant_deg: Option<f64>,
}

pub(super) fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    if let Some(sigma) = args.constant_deg.filter(|s| !(*s > 0.0 && *s <= 103.0)) {
        let message = format!("--constant-deg is {sigma}; it must be above 0, at most 103");
        return Err(CliError::input(message));
    }
    let setups = SigmaSetup::ALL.len();
    let report = args.flown.campaign(context, setups, |scenario, estimators, repetition| {
        sigmas_campaign(registry, scenario, estimators, args.constant_deg, repetition)
    })?;
    output.result(&report, tables)
}

fn tables(report: &SigmasReport) -> String {
    let mut lines =
        vec![format!("{}, {} runs, seeds from {}", report.scenario, report.runs, report.seed)];
    let mut bearings = table(&[
        "bearings of",
        "n",
        "without",
        "rms °",
        "σ °",
        "r",
        "p",
        "r of a hunt",
        "p < 0.05",
        "level dB",
        "rms dB",
        "σ ×",
        "floor °",
    ]);
    for campaign in &report.estimators {
        let Some(found) = &campaign.bearings else { continue };
        let hunts = |r: &Spread| format!("{:.2} ({:.2} to {:.2})", r.p50, r.p10, r.p90);
        bearings.add_row([
            campaign.estimator.clone(),
            found.bearings.to_string(),
            found.without.to_string(),
            number(Some(found.rms_deg), 1),
            number(Some(found.sigma_deg), 1),
            number(found.correlation, 2),
            text(found.correlation_p.map(|p| format!("{p:.1e}"))),
            text(found.hunt_correlation.as_ref().map(hunts)),
            format!("{:.0} %", 100.0 * found.significant_hunts),
            number(Some(found.level_mean_db), 2),
            number(Some(found.level_rms_db), 2),
            number(found.fitted.map(|(scale, _)| scale), 2),
            number(found.fitted.map(|(_, floor)| floor), 1),
        ]);
    }
    lines.push(bearings.to_string());
    let mut errors = table(&[
        "estimator",
        "beacon",
        "σ",
        "p50",
        "p90",
        "rms",
        "ANEES",
        "in 95 %",
        "failed",
        "ratio",
        "95 %",
        "p",
    ])
    .named_by(3);
    for campaign in &report.estimators {
        for setup in &campaign.setups {
            for beacon in &setup.campaign.beacons {
                let error = |pick: fn(&Spread) -> f64| number(beacon.error_m.as_ref().map(pick), 2);
                let compared = campaign.comparisons.iter();
                let paired = compared
                    .filter(|c| c.setup == setup.setup && c.beacon == beacon.name)
                    .find_map(|comparison| comparison.paired);
                let interval = paired.map(|p| p.ratio_interval);
                errors.add_row([
                    campaign.estimator.clone(),
                    beacon.name.clone(),
                    setup.setup.name().to_owned(),
                    error(|e| e.p50),
                    error(|e| e.p90),
                    error(|e| e.rms),
                    number(beacon.anees, 2),
                    text(beacon.coverage_95.map(|share| format!("{:.1} %", 100.0 * share))),
                    beacon.failed.to_string(),
                    number(paired.map(|p| p.ratio), 3),
                    text(interval.map(|[low, high]| format!("{low:.2} to {high:.2}"))),
                    text(paired.map(|p| format!("{:.1e}", p.p_value))),
                ]);
            }
        }
    }
    lines.push(errors.to_string());
    lines.push(LEGEND.to_owned());
    lines.join("\n")
}

/// Meaning of the columns.
const LEGEND: &str = "Errors in metres. r is the correlation of σ with |error|, p its Student's \
     test; level and rms dB are those of levels minus the model's law; σ × and floor fit σ to the \
     errors. The ratio is the geometric mean of the error over that with the constant σ, run by \
     run on the same seeds, with p of Student's paired t-test on the logarithms: below 1 the σ \
     gains.";
