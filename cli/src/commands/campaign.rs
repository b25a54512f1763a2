//! Campaigns of simulated hunts, and the tables of their reports.

use std::{
    fs::File,
    io::{BufWriter, Write},
    path::PathBuf,
};

use foxhunt::{
    campaign::{BeaconCampaign, CampaignReport, EstimatorCampaign, campaign_watched},
    document,
    registry::EstimatorEntry,
    report::HuntReport,
    scenario::DEFAULT_SCENARIO,
    trial::builtin_trials,
};

use super::{
    choice,
    settings::{Planning, Runs, Settings},
};
use crate::{
    error::CliError,
    output::{Context, event, warn},
    table::{number, table, text},
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
pub struct Args {
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

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
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

/// Meaning of the columns.
const LEGEND: &str = "Errors in metres. A consistent estimator's ANEES lies in the interval with \
     95 %, and 95 % of its ellipses hold the truth; an over-confident one has a larger ANEES, and \
     fewer of its ellipses do. The verdict \"too few\" means that a covariance 1.5 times too \
     small would not be noticed. To 3 m: the median number of steps until the 95 % ellipse's \
     semi-major axis is below 3 m, a dash where more than half of the runs never get there. \
     Path: the median of what all drones flew together.";

/// One table for each beacon.
pub fn tables(report: &CampaignReport) -> String {
    let mut lines =
        vec![format!("{}, {} runs, seeds from {}", report.scenario, report.runs, report.seed)];
    let names = report.estimators.first().map_or(&[][..], |e| &e.beacons);
    for (index, beacon) in names.iter().enumerate() {
        let mut beacons = table(&[
            &beacon.name,
            "p10",
            "p50",
            "p90",
            "mean",
            "rms",
            "max",
            "steps",
            "to 3 m",
            "path m",
            "ANEES",
            "interval",
            "verdict",
            "in 95 %",
            "ANIS",
            "interval",
            "failed",
        ]);
        for estimator in &report.estimators {
            if let Some(beacon) = estimator.beacons.get(index) {
                beacons.add_row(row(&estimator.estimator, beacon));
            }
        }
        lines.push(beacons.to_string());
        lines.extend(transmitters(report, index));
        lines.extend(checkpoints(report, index));
    }
    let estimators = report.estimators.iter();
    lines.extend(estimators.filter(|e| e.beacons.iter().any(|b| all_alike(b, report.runs))).map(
        |e| {
            format!(
                "{}: all runs ended with one and the same error, so the seed changed nothing. The \
                 noise of an own source follows the seed with `World::source_seed`.",
                e.estimator
            )
        },
    ));
    lines.push(LEGEND.to_owned());
    lines.join("\n")
}

/// Returns true if several runs have one and the same error: they are one run, many times.
fn all_alike(beacon: &BeaconCampaign, runs: u32) -> bool {
    runs.saturating_sub(beacon.failed) > 1 && beacon.error_m.is_some_and(|e| e.p10 >= e.max)
}

/// The estimators with their figures of one beacon.
fn of_beacon(
    report: &CampaignReport,
    index: usize,
) -> impl Iterator<Item = (&EstimatorCampaign, &BeaconCampaign)> {
    report.estimators.iter().filter_map(move |e| Some((e, e.beacons.get(index)?)))
}

/// The transmitters on a beacon's frequency, where an estimator looks for several.
fn transmitters(report: &CampaignReport, index: usize) -> Option<String> {
    let found = of_beacon(report, index).filter_map(|(e, beacon)| Some((e, beacon.transmitters?)));
    let mut found = found.peekable();
    let _ = found.peek()?;
    let mut several = table(&[
        "transmitters on one frequency",
        "GOSPA m mean",
        "p50",
        "p90",
        "all found, none invented",
        "missed",
        "invented",
    ]);
    for (estimator, transmitters) in found {
        several.add_row([
            estimator.estimator.clone(),
            number(Some(transmitters.gospa_m.mean), 2),
            number(Some(transmitters.gospa_m.p50), 2),
            number(Some(transmitters.gospa_m.p90), 2),
            format!("{:.1} %", 100.0 * transmitters.right),
            transmitters.missed.to_string(),
            transmitters.invented.to_string(),
        ]);
    }
    Some(several.to_string())
}

/// The root mean square errors at the checkpoints, where the trial has any.
fn checkpoints(report: &CampaignReport, index: usize) -> Option<String> {
    let beacons = || of_beacon(report, index);
    let (_, first) = beacons().next()?;
    if first.checkpoints.is_empty() && first.track_rms_m.is_none() {
        return None;
    }
    let after = first.checkpoints.iter().map(|point| format!("after {}", point.measurements));
    let columns: Vec<String> = ["rms on the way".to_owned()]
        .into_iter()
        .chain(after)
        .chain(["at the end".to_owned(), "whole track".to_owned()])
        .collect();
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    let mut way = table(&columns);
    for (estimator, beacon) in beacons() {
        let rms = beacon.checkpoints.iter().map(|point| number(point.error_m.map(|e| e.rms), 2));
        let name = [estimator.estimator.clone()].into_iter();
        let end = [number(beacon.error_m.map(|e| e.rms), 2), number(beacon.track_rms_m, 2)];
        way.add_row(name.chain(rms).chain(end));
    }
    if first.bound_m.is_some() {
        let bounds = first.checkpoints.iter().map(|point| number(point.bound_m, 2));
        let end = [number(first.bound_m, 2), number(None, 2)];
        way.add_row(["Cramér-Rao bound".to_owned()].into_iter().chain(bounds).chain(end));
    }
    Some(way.to_string())
}

fn row(estimator: &str, beacon: &BeaconCampaign) -> Vec<String> {
    let error = |pick: fn(&foxhunt::Spread) -> f64| number(beacon.error_m.as_ref().map(pick), 2);
    let interval =
        |at: Option<[f64; 2]>| text(at.map(|[low, high]| format!("{low:.2} to {high:.2}")));
    vec![
        estimator.to_owned(),
        error(|e| e.p10),
        error(|e| e.p50),
        error(|e| e.p90),
        error(|e| e.mean),
        error(|e| e.rms),
        error(|e| e.max),
        number(beacon.steps.map(|steps| steps.mean), 1),
        number(beacon.steps_to_3m.and_then(|steps| steps.p50), 1),
        number(beacon.path_m.map(|path| path.p50), 0),
        number(beacon.anees, 2),
        interval(beacon.anees_interval),
        beacon.verdict.to_string(),
        text(beacon.coverage_95.map(|share| format!("{:.1} %", 100.0 * share))),
        number(beacon.anis, 2),
        interval(beacon.anis_interval),
        beacon.failed.to_string(),
    ]
}
