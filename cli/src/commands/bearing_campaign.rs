use foxhunt::{
    bearing_trial::{BearingCampaignError, BearingCase, BearingReport, bearing_campaign},
    config::{NamedExtractor, antenna_named, extractors},
};

use super::extraction::{self, Extraction};
use crate::{
    error::CliError,
    output::Output,
    progress::Progress,
    table::{number, table},
};

/// Compares the extractors on simulated turns.
pub(super) fn run(
    case: &BearingCase,
    extraction: &Extraction,
    (runs, seed, jobs): (u32, u64, usize),
    output: Output,
) -> Result<(), CliError> {
    let asked: Vec<NamedExtractor> = match extraction.name() {
        Some(name) => vec![extraction::named(name)?],
        None => extractors(),
    };
    let antenna = extraction.antenna().map(antenna_named).unwrap_or_default();
    let progress = Progress::new("turns", u64::from(runs));
    let report = bearing_campaign(case, &antenna, &asked, runs, seed, jobs, &|| progress.step());
    progress.finish();
    let report = report.map_err(|error| match error {
        BearingCampaignError::Threads { .. } => CliError::failure(error),
        error => CliError::input(error),
    })?;
    output.result(&report, text)
}

const LEGEND: &str = "Errors and σ in degrees. For an honest extractor error/σ is 1 in the root mean \
     square, and 95 % of the\nerrors lie within 1.96 σ. r is the correlation of σ and error.";

fn text(report: &BearingReport) -> String {
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
        "{}, {} turns, seeds from {}; Cramér-Rao bound {:.2}° without reflections\n{rows}\n{LEGEND}",
        report.campaign, report.runs, report.seed, report.bound_deg
    )
}
