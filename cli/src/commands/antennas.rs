use foxhunt::{
    campaign::{AntennasReport, BeaconCampaign, CampaignError, antennas_campaign},
    config::NamedEstimator,
    scenario::{DEFAULT_SCENARIO, Scenario},
};

use super::choice;
use crate::{
    error::CliError,
    output::Output,
    progress::Progress,
    table::{number, table, text},
};

/// What `foxhunt campaign` calls the comparison of antennas.
pub(super) const NAME: &str = "antennas";

/// The scenario that is flown with each antenna.
pub(super) fn scenario() -> Result<Scenario, CliError> {
    choice::scenario(DEFAULT_SCENARIO)
}

/// Flies the scenario with each antenna and compares them.
pub(super) fn run(
    scenario: &Scenario,
    estimators: &[NamedEstimator],
    runs: u32,
    seed: u64,
    jobs: usize,
    output: Output,
) -> Result<(), CliError> {
    let setups = foxhunt::campaign::AntennaSetup::ALL.len();
    let hunts = u64::try_from(estimators.len() * setups).unwrap_or(u64::MAX);
    let progress = Progress::new("hunts", u64::from(runs).saturating_mul(hunts));
    let report = antennas_campaign(scenario, estimators, runs, seed, jobs, &|| progress.step());
    progress.finish();
    let report = report.map_err(|error| match error {
        CampaignError::Simulation(error) => choice::simulation_error(error, NAME),
        error => CliError::failure(error),
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
    ]);
    for campaign in &report.setups {
        for (estimator, duration) in campaign.estimators.iter().zip(&campaign.duration_s) {
            for beacon in &estimator.beacons {
                let error = |pick: fn(&foxhunt::campaign::Spread) -> f64| {
                    number(beacon.error_m.as_ref().map(pick), 2)
                };
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
    ]);
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

/// What the columns mean.
const LEGEND: &str = "Errors in metres. The ratio is the geometric mean of the two errors' ratios \
     run by run, on the\nsame seeds; where its interval leaves out 1, the antennas differ. p is \
     that of Student's paired t-test\non the logarithms.";
