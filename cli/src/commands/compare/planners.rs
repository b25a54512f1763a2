use foxhunt::{
    FirstPassage, Paired,
    campaign::{
        OutcomeCount, PLANNER_SCENARIOS, PlannerComparison, PlannersReport, planners_campaign,
    },
    registry::{EstimatorEntry, PlannerEntry, Registry},
    scenario::Scenario,
};

use crate::{
    commands::{
        choice,
        settings::{Runs, Settings},
    },
    error::CliError,
    output::Context,
    table::{markdown, number, table, text},
};

/// Compare planners in flown hunts
///
/// Flies every scenario with every planner, and compares each planner with the reference's, run by
/// run: the time until the 95 % ellipse's semi-major axis is below 3 m, the path and the errors.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt compare planners --runs 100 --estimator grid\n  \
                        foxhunt compare planners far-start --runs 100 --planner information \
                        --planner orbit")]
pub struct Args {
    /// Built-in scenarios (`foxhunt list scenarios`) or TOML files
    #[arg(value_name = "SCENARIO", default_values = PLANNER_SCENARIOS)]
    scenarios: Vec<String>,
    #[command(flatten)]
    runs: Runs,
    /// A planner to compare with pritzl2018; may be repeated [default: all]
    #[arg(long, value_name = "NAME")]
    planner: Vec<String>,
    /// The estimator [default: each scenario's own]
    #[arg(long, value_name = "NAME")]
    estimator: Option<String>,
    /// Print two tables in Markdown, for documents: their rows are as wide as they need
    #[arg(long)]
    markdown: bool,
    #[command(flatten)]
    settings: Settings,
}

/// The planner that others are compared with.
const REFERENCE: &str = "pritzl2018";

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    let planners = compared(&args.planner, registry);
    let mut hunts: Vec<(Scenario, EstimatorEntry)> = Vec::new();
    for name in &args.scenarios {
        let mut scenario = choice::scenario(name)?;
        args.settings.apply_to(&mut scenario, registry)?;
        let given = args.estimator.as_deref();
        let estimator = choice::estimator_of(registry, given, &scenario, name)?;
        hunts.push((scenario, args.settings.estimator(estimator)?));
    }
    let contenders = hunts.len() * planners.len();
    let reports = args.runs.with_progress(output, "hunts", contenders, |repetition| {
        let fly = |(scenario, estimator): &(Scenario, EstimatorEntry)| {
            planners_campaign(registry, scenario, estimator, &planners, repetition)
                .map_err(|error| choice::campaign_error(error, &scenario.name))
        };
        hunts.iter().map(fly).collect::<Result<Vec<PlannersReport>, _>>()
    })?;
    let text = if args.markdown { for_documents } else { tables };
    output.result(&reports, |reports| text(reports))
}

/// The planners that are compared, the reference's first.
fn compared(given: &[String], registry: &Registry) -> Vec<PlannerEntry> {
    let mut planners = registry.planners().to_vec();
    if !given.is_empty() {
        planners.retain(|entry| {
            entry.name == REFERENCE || given.iter().any(|name| *name == entry.name)
        });
    }
    planners.sort_by_key(|entry| entry.name != REFERENCE);
    planners
}

/// Columns of a planner's figures.
const FIGURES: [&str; 9] = [
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

/// Columns of a comparison.
const RATIOS: [&str; 4] = ["steps to 3 m", "s to 3 m", "path", "error"];

/// Number of columns before these that name a row.
const NAMES: usize = 4;

/// Tables for each scenario: the figures of each beacon, and the ratios to the reference.
fn tables(reports: &[PlannersReport]) -> String {
    let mut lines = vec![head(reports)];
    for report in reports {
        lines.push(format!("{}, {}", report.scenario, report.estimator));
        let mut figures = table(&[&["beacon", "planner"], &FIGURES[..]].concat()).named_by(2);
        for row in rows(report) {
            let [_, beacon, planner, _, of @ ..] = row.as_slice() else { continue };
            figures.add_row([beacon, planner].into_iter().chain(of));
        }
        let mut ratios = table(&[&["beacon", "planner"], &RATIOS[..]].concat()).named_by(2);
        for comparison in &report.comparisons {
            let row = ratio(&report.scenario, comparison);
            let [_, beacon, planner, _, of @ ..] = row.as_slice() else { continue };
            ratios.add_row([beacon, planner].into_iter().chain(of));
        }
        lines.push(format!("{figures}\nover {REFERENCE}:\n{ratios}\n"));
    }
    lines.push(LEGEND.to_owned());
    lines.join("\n")
}

fn head(reports: &[PlannersReport]) -> String {
    reports.first().map_or_else(String::new, |first| {
        format!("{} runs, seeds from {}\n", first.runs, first.seed)
    })
}

/// All scenarios in two tables in Markdown.
fn for_documents(reports: &[PlannersReport]) -> String {
    let mut figures = Vec::new();
    let mut ratios = Vec::new();
    for report in reports {
        figures.extend(rows(report));
        ratios.extend(report.comparisons.iter().map(|paired| ratio(&report.scenario, paired)));
    }
    let columns = [&["scenario", "beacon", "planner", "estimator"], &FIGURES[..]].concat();
    let figures = markdown(&columns, NAMES, &figures);
    let columns = [&["scenario", "beacon", "planner", "against"], &RATIOS[..]].concat();
    let ratios = markdown(&columns, NAMES, &ratios);
    format!("{}\n{figures}\n\n{ratios}\n\n{LEGEND}", head(reports))
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

/// Outcomes of searches with their counts; searches that did not end are the rest of the runs.
fn outcomes(counts: &[OutcomeCount], runs: u32) -> String {
    let ended = counts.iter().map(|count| count.runs).sum::<u32>();
    let failed = runs.saturating_sub(ended);
    let mut texts: Vec<String> =
        counts.iter().map(|count| format!("{} {}", count.runs, count.outcome)).collect();
    if failed > 0 {
        texts.push(format!("{failed} not over"));
    }
    texts.join(", ")
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

/// Meaning of the columns.
const LEGEND: &str = "To 3 m: the median until the 95 % ellipse's semi-major axis is below 3 m; a \
     run that never gets there counts as infinite. Path: the median of what all drones flew \
     together. The second table has geometric means of the ratios run by run, on the same seeds, \
     of runs that have both, with 95 % intervals.";
