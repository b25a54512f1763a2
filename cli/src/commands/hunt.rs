use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
};

use foxhunt::{
    config::NamedEstimator,
    hunt::Event,
    log::{LogHeader, LogWriter},
    picture::hunt_svg,
    report::{HuntReport, HuntedBeacon},
    scenario::{DEFAULT_SCENARIO, Scenario},
    simulation::{Simulated, log_header, simulate},
};

use super::{
    calibration::Calibration, choice, extraction::Extraction, fixes, overrides::Overrides,
    planning::Planning, telling::tell,
};
use crate::{error::CliError, output::Output};

/// Fly one simulated hunt
///
/// Flies the drones of a scenario through a simulated hunt for its beacons, one after the other or,
/// where turns are shared, all at once. Ends with a table of fixes against the truth, and leaves a log and a picture behind.
/// The same scenario, estimator and seed fly the same hunt.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt hunt\n  \
                        foxhunt hunt pritzl-6.1 --estimator particle --seed 7 --out hunts/7\n  \
                        foxhunt hunt --planner waypoints\n  \
                        foxhunt --json hunt my-field.toml > result.json")]
pub(crate) struct Args {
    /// A built-in scenario (`foxhunt scenarios` lists them) or a TOML file
    #[arg(default_value = DEFAULT_SCENARIO)]
    scenario: String,
    /// The seed of everything that is drawn at random
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// The estimator; the scenario's own unless given (`foxhunt estimators` explains them)
    #[arg(long, value_name = "NAME", value_parser = choice::estimator_parser())]
    estimator: Option<String>,
    #[command(flatten)]
    planning: Planning,
    #[command(flatten)]
    extraction: Extraction,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    calibration: Calibration,
    /// The folder that hunt.jsonl (the log) and hunt.svg (the picture) are written to
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
}

pub(crate) fn run(args: &Args, output: Output) -> Result<(), CliError> {
    let mut scenario = choice::scenario(&args.scenario)?;
    args.calibration.read()?.tell(&mut scenario);
    args.overrides.tell(&mut scenario);
    args.planning.tell(&mut scenario)?;
    scenario.extractor = args.extraction.config(&scenario.extractor)?;
    args.overrides.warn_of(&scenario);
    let estimator = choice::estimator_of(args.estimator.as_deref(), &scenario, &args.scenario)?;
    let estimator = args.overrides.apply(estimator);
    let header = log_header(&scenario, &estimator, args.seed);
    fs::create_dir_all(&args.out).map_err(|error| CliError::writing(&args.out, error))?;

    let log = args.out.join("hunt.jsonl");
    let (hunt, events) = fly(args, &scenario, &estimator, &header, &log)?;

    let picture = args.out.join("hunt.svg");
    let svg = hunt_svg(&header, &events).map_err(CliError::failure)?;
    fs::write(&picture, svg).map_err(|error| CliError::writing(&picture, error))?;

    let report = HuntReport::new(args.seed, estimator.name, args.planning.name(), &hunt);
    output.result(&report, text)?;
    output.note(&format!("log: {}\npicture: {}", log.display(), picture.display()))
}

/// Flies the hunt into a log, and keeps its events for the picture.
fn fly(
    args: &Args,
    scenario: &Scenario,
    estimator: &NamedEstimator,
    header: &LogHeader,
    log: &Path,
) -> Result<(Simulated, Vec<Event>), CliError> {
    // A scenario that cannot be flown has no event, and leaves the log of the hunt before.
    let mut writer = None;
    let mut events = Vec::new();
    let hunt = simulate(scenario, estimator, args.seed, |event| {
        tell(event);
        events.push(event.clone());
        let mut log_event = || match &mut writer {
            Some(writer) => LogWriter::event(writer, event),
            None => {
                let begun = LogWriter::new(File::create(log)?, header)?;
                writer.insert(begun).event(event)
            }
        };
        log_event().map_err(|source| NotLogged { path: log.to_owned(), source })
    });
    let hunt = hunt.map_err(|error| choice::simulation_error(error, &args.scenario))?;
    Ok((hunt, events))
}

/// An event that could not be written down.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot be written: {source}", path.display())]
struct NotLogged {
    path: PathBuf,
    source: io::Error,
}

fn text(report: &HuntReport) -> String {
    format!(
        "{}, seed {}, {:.0} simulated seconds\n{}\n{}",
        report.estimator,
        report.seed,
        report.duration_s,
        fixes::fixes(report.beacons.iter().map(row)),
        fixes::LEGEND
    )
}

/// A row of the table of fixes.
fn row(beacon: &HuntedBeacon) -> fixes::Row<'_> {
    fixes::Row {
        beacon: &beacon.name,
        estimate: beacon.estimate,
        ellipse_95: beacon.ellipse_95,
        error_m: Some(beacon.error_m),
        nees: beacon.nees,
        steps: beacon.steps,
        outcome: beacon.outcome.to_string(),
    }
}
