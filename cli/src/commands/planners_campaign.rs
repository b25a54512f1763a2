use foxhunt::{
    campaign::{
        CampaignError, FirstPassage, OutcomeCount, Paired, PlannerComparison, PlannersReport,
        planners_campaign,
    },
    config::{NamedEstimator, NamedPlanner},
    scenario::Scenario,
};

use super::choice;
use crate::{
    error::CliError,
    output::Output,
    progress::Progress,
    table::{markdown, number, text},
};

/// What `foxhunt campaign` calls the comparison of planners.
pub(super) const NAME: &str = "planners";

/// Flies each scenario with each planner and compares them.
pub(super) fn run(
    hunts: &[(Scenario, NamedEstimator)],
    planners: &[NamedPlanner],
    runs: u32,
    seed: u64,
    jobs: usize,
    output: Output,
) -> Result<(), CliError> {
    let flown = u64::try_from(hunts.len() * planners.len()).unwrap_or(u64::MAX);
    let progress = Progress::new("hunts", u64::from(runs).saturating_mul(flown));
    let fly = |(scenario, estimator): &(Scenario, NamedEstimator)| {
        let step = || progress.step();
        planners_campaign(scenario, estimator, planners, runs, seed, jobs, &step).map_err(|error| {
            match error {
                CampaignError::Simulation(error) => choice::simulation_error(error, &scenario.name),
                error => CliError::failure(error),
            }
        })
    };
    let reports: Vec<PlannersReport> = hunts.iter().map(fly).collect::<Result<_, _>>()?;
    progress.finish();
    output.result(&reports, |reports| tables(reports))
}

fn tables(reports: &[PlannersReport]) -> String {
    let (mut figures, mut ratios) = (Vec::new(), Vec::new());
    for report in reports {
        figures.extend(rows(report));
        ratios.extend(report.comparisons.iter().map(|paired| ratio(&report.scenario, paired)));
    }
    let told = reports.first().map_or_else(String::new, |first| {
        format!("{} runs, seeds from {}\n", first.runs, first.seed)
    });
    let columns = [
        "scenario",
        "beacon",
        "planner",
        "estimator",
        "steps to 3 m",
        "s to 3 m",
        "never",
        "path m",
        "rms m",
        "p90 m",
        "ANEES",
        "interval",
        "outcomes",
    ];
    let figures = markdown(&columns, 4, &figures);
    let columns =
        ["scenario", "beacon", "planner", "against", "steps to 3 m", "s to 3 m", "path", "error"];
    let ratios = markdown(&columns, 4, &ratios);
    format!("{told}\n{figures}\n\n{ratios}\n\n{LEGEND}")
}

fn rows(report: &PlannersReport) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    let beacons = report.planners.first().map_or(0, |first| first.beacons.len());
    for index in 0..beacons {
        for planner in &report.planners {
            let Some(beacon) = planner.beacons.get(index) else { continue };
            let figures = &beacon.figures;
            let median = |passage: Option<FirstPassage>| passage.and_then(|passage| passage.p50);
            let interval = figures.anees_interval;
            rows.push(vec![
                report.scenario.clone(),
                figures.name.clone(),
                planner.planner.clone(),
                report.estimator.clone(),
                number(median(figures.steps_to_3m), 1),
                number(median(figures.time_to_3m_s), 0),
                text(figures.steps_to_3m.map(|steps| steps.never)),
                number(figures.path_m.map(|path| path.p50), 0),
                number(figures.error_m.map(|error| error.rms), 2),
                number(figures.error_m.map(|error| error.p90), 2),
                number(figures.anees, 2),
                text(interval.map(|[low, high]| format!("{low:.2} to {high:.2}"))),
                outcomes(&beacon.outcomes, report.runs),
            ]);
        }
    }
    rows
}

/// How searches ended; those that did not are the rest of the runs.
fn outcomes(counts: &[OutcomeCount], runs: u32) -> String {
    let ended = counts.iter().map(|count| count.runs).sum::<u32>();
    let failed = runs.saturating_sub(ended);
    let mut told: Vec<String> =
        counts.iter().map(|count| format!("{} {}", count.runs, count.outcome)).collect();
    if failed > 0 {
        told.push(format!("{failed} not over"));
    }
    told.join(", ")
}

fn ratio(scenario: &str, comparison: &PlannerComparison) -> Vec<String> {
    let ratio = |paired: Option<Paired>| {
        text(paired.map(|Paired { ratio, ratio_interval: [low, high], .. }| {
            format!("{ratio:.2} ({low:.2} to {high:.2})")
        }))
    };
    vec![
        scenario.to_owned(),
        comparison.beacon.clone(),
        comparison.planner.clone(),
        comparison.against.clone(),
        ratio(comparison.steps_to_3m),
        ratio(comparison.time_to_3m_s),
        ratio(comparison.path_m),
        ratio(comparison.error_m),
    ]
}

/// What the columns mean.
const LEGEND: &str = "To 3 m: the median until the 95 % ellipse's semi-major axis is below 3 m; a \
     run that never gets\nthere counts as infinite. Path: the median of what all drones flew together. \
     The second table has\ngeometric means of the ratios run by run, on the same seeds, of runs that \
     have both, with 95 %\nintervals.";
