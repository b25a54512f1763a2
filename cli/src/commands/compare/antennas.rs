use foxhunt::{
    Spread,
    campaign::{AntennaSetup, AntennasReport, BeaconCampaign, antennas_campaign},
};

use super::flown::Flown;
use crate::{
    context::Context,
    error::CliError,
    table::{number, table, text},
};

/// Compare antennas in flown hunts
///
/// Flies a scenario with an omnidirectional antenna, with a directional one on a body that turns,
/// and with one on a stepper, and compares the errors run by run.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  foxhunt compare antennas --runs 200 --estimator grid")]
pub(super) struct Args {
    #[command(flatten)]
    flown: Flown,
}

pub(super) fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    let setups = AntennaSetup::ALL.len();
    let report = args.flown.campaign(context, setups, |scenario, estimators, repetition| {
        antennas_campaign(registry, scenario, estimators, repetition)
    })?;
    output.result(&report, tables)
}

fn tables(report: &AntennasReport) -> String {
    let mut lines =
        vec![format!("{}, {} runs, seeds from {}", report.scenario, report.runs, report.seed)];
    let mut errors = table(&[
        "antenna",
        "estimator",
        "beacon",
        "p50",
        "p90",
        "rms",
        "steps",
        "ANEES",
        "in 95 %",
        "failed",
        "hunt s",
    ])
    .named_by(3);
    for campaign in &report.setups {
        for (estimator, duration) in campaign.estimators.iter().zip(&campaign.duration_s) {
            for beacon in &estimator.beacons {
                let error = |pick: fn(&Spread) -> f64| number(beacon.error_m.as_ref().map(pick), 2);
                errors.add_row([
                    campaign.setup.name().to_owned(),
                    estimator.estimator.clone(),
                    beacon.name.clone(),
                    error(|e| e.p50),
                    error(|e| e.p90),
                    error(|e| e.rms),
                    number(beacon.steps.map(|steps| steps.mean), 1),
                    number(beacon.anees, 2),
                    coverage(beacon),
                    beacon.failed.to_string(),
                    number(duration.map(|d| d.mean), 0),
                ]);
            }
        }
    }
    lines.push(errors.to_string());
    let mut ratios = table(&[
        "estimator",
        "beacon",
        "error with",
        "over that with",
        "ratio",
        "95 %",
        "p",
        "pairs",
    ])
    .named_by(4);
    for comparison in &report.comparisons {
        let paired = comparison.paired.as_ref();
        ratios.add_row([
            comparison.estimator.clone(),
            comparison.beacon.clone(),
            comparison.setup.name().to_owned(),
            comparison.against.name().to_owned(),
            number(paired.map(|p| p.ratio), 2),
            text(
                paired.map(|p| format!("{:.2} to {:.2}", p.ratio_interval[0], p.ratio_interval[1])),
            ),
            text(paired.map(|p| format!("{:.1e}", p.p_value))),
            text(paired.map(|p| p.pairs)),
        ]);
    }
    lines.push(ratios.to_string());
    lines.push(LEGEND.to_owned());
    lines.join("\n")
}

fn coverage(beacon: &BeaconCampaign) -> String {
    text(beacon.coverage_95.map(|share| format!("{:.1} %", 100.0 * share)))
}

/// Meaning of the columns.
const LEGEND: &str = "Errors in metres. The ratio is the geometric mean of the two errors' ratios \
     run by run, on the same seeds; where its interval leaves out 1, the antennas differ. p is \
     that of Student's paired t-test on the logarithms.";
