use std::thread::available_parallelism;

use clap::value_parser;
use foxhunt::{
    bearing_trial::bearing_case_named,
    campaign::{BeaconCampaign, CampaignError, CampaignReport, PLANNER_SCENARIOS, campaign},
    config::NamedEstimator,
    scenario::{DEFAULT_SCENARIO, Scenario},
    trial::{Trial, trial_campaign},
};

use super::{
    antennas, bearing_campaign, calibration::Calibration, choice, extraction::Extraction,
    fleets_campaign as fleets, overrides::Overrides, planners_campaign as planners,
    planning::Planning,
};
use crate::{
    error::CliError,
    output::Output,
    progress::Progress,
    table::{number, table, text},
};

/// Fly a hunt many times and compare estimators
///
/// Flies the same scenario again and again, each run with the next seed, with each estimator on
/// the same runs. Tells how the errors are spread, how many steps a fix takes, and whether the
/// estimators know how good they are. The result does not depend on the number of jobs.
///
/// A trial is a scenario without a flight: bearings on a target of known course are drawn from a
/// stated density, and the errors are told at checkpoints, too. The trials of Isaacs et al. 2014
/// are scenarios that fly as well: `--flown` tells one from the other.
///
/// `antennas` flies the default scenario with an omnidirectional antenna, with a directional one
/// on a body that turns, and with one on a stepper, and compares the errors run by run.
///
/// `planners` flies pritzl-6.1, far-start, three-beacons and one-drone with every planner, and compares
/// each with the reference's, run by run: how long until the 95 % ellipse's semi-major axis is below
/// 3 m, how far the drones fly, how large the errors are. `--planner` compares that one alone. The
/// tables are Markdown.
///
/// `fleets` flies fleets of one to eight drones in which everything is random that may go wrong, and
/// tells whether drones ever came too near to each other, left the fence or the band of altitudes,
/// or were in the air with empty batteries, and how hunts ended. `fleet-` and a seed is the
/// scenario of one of them. The exit code is 1 where that happened, or where a hunt failed.
///
/// bearing-clean, bearing-lost, bearing-reflector, bearing-65 and bearing-block compare the
/// extractors of bearings on simulated turns of the antenna.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt campaign --runs 100\n  \
                        foxhunt campaign pritzl-6.1 --runs 1000 --estimator ukf-pritzl2018 \
                        --estimator ekf-pritzl2018\n  \
                        foxhunt campaign isaacs-static --flown --runs 100\n  \
                        foxhunt campaign antennas --runs 200 --estimator grid\n  \
                        foxhunt campaign planners --runs 100 --estimator grid\n  \
                        foxhunt campaign fleets --runs 10000\n  \
                        foxhunt campaign bearing-reflector --runs 2000 --antenna panel.msi")]
pub(crate) struct Args {
    /// A built-in scenario (`foxhunt scenarios` lists them), a TOML file, `antennas`, `planners`, `fleets`, or one of
    /// bearing-clean, bearing-lost, bearing-reflector, bearing-65 and bearing-block
    #[arg(default_value = DEFAULT_SCENARIO)]
    scenario: String,
    /// How many hunts each estimator flies
    #[arg(long, value_name = "N", value_parser = value_parser!(u32).range(1..))]
    runs: u32,
    /// How many hunts are flown at the same time; as many as the machine has cores unless given
    #[arg(long, value_name = "J", value_parser = value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// The seed of the first run; run i has this plus i
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// An estimator, again for each more; the scenario's own unless given
    #[arg(long, value_name = "NAME", value_parser = choice::estimator_parser())]
    estimator: Vec<String>,
    /// Fly a scenario that is also the name of a trial: with `isaacs-static`, samples are drawn and
    /// not bearings
    #[arg(long)]
    flown: bool,
    #[command(flatten)]
    planning: Planning,
    #[command(flatten)]
    extraction: Extraction,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    calibration: Calibration,
}

pub(crate) fn run(args: &Args, output: Output) -> Result<(), CliError> {
    let jobs = match args.jobs {
        Some(jobs) => usize::from(jobs),
        None => available_parallelism().map_or(1, usize::from),
    };
    if let Some(case) = bearing_case_named(&args.scenario) {
        let others = [
            args.flown,
            args.overrides.any(),
            args.calibration.is_given(),
            args.planning.is_given(),
        ];
        if others.contains(&true) || !args.estimator.is_empty() {
            return Err(CliError::input(format!(
                "{} compares extractors; it takes neither estimators nor what they are told, nor a \
                 planner",
                case.name
            )));
        }
        let draw = (args.runs, args.seed, jobs);
        return bearing_campaign::run(&case, &args.extraction, draw, output);
    }
    let trial = choice::trial(&args.scenario)?;
    if args.flown && trial.is_none() {
        let message = format!("--flown is for names of trials; {} is none", args.scenario);
        return Err(CliError::input(message));
    }
    if let Some(trial) = trial.filter(|_| !args.flown) {
        return run_trial(args, &trial, jobs, output);
    }
    if args.scenario == fleets::NAME {
        return run_fleets(args, jobs, output);
    }
    if args.scenario == planners::NAME {
        return run_planners(args, jobs, output);
    }
    let mut scenario = match args.scenario.as_str() {
        antennas::NAME => antennas::scenario()?,
        name => choice::scenario(name)?,
    };
    args.planning.tell(&mut scenario)?;
    tell(args, &mut scenario)?;
    let estimators: Vec<_> =
        estimators(args, &scenario)?.into_iter().map(|e| args.overrides.apply(e)).collect();
    if args.scenario == antennas::NAME {
        return antennas::run(&scenario, &estimators, args.runs, args.seed, jobs, output);
    }
    let hunts = u64::from(args.runs) * u64::try_from(estimators.len()).unwrap_or(u64::MAX);
    let progress = Progress::new("hunts", hunts);
    let report = campaign(&scenario, &estimators, args.runs, args.seed, jobs, &|| progress.step());
    progress.finish();
    let mut report = report.map_err(|error| match error {
        CampaignError::Simulation(error) => choice::simulation_error(error, &args.scenario),
        error => CliError::failure(error),
    })?;
    report.planner = Some(args.planning.name().to_owned());
    output.result(&report, tables)
}

/// Tells a scenario what was asked for otherwise, but for its planner.
fn tell(args: &Args, scenario: &mut Scenario) -> Result<(), CliError> {
    args.calibration.read()?.tell(scenario);
    args.overrides.tell(scenario);
    scenario.extractor = args.extraction.config(&scenario.extractor)?;
    args.overrides.warn_of(scenario);
    Ok(())
}

fn run_fleets(args: &Args, jobs: usize, output: Output) -> Result<(), CliError> {
    let others = [args.overrides.any(), args.calibration.is_given(), args.extraction.any()];
    if others.contains(&true) || args.estimator.len() > 1 {
        let message = "fleets are drawn at random; of a hunt they are told one --planner and one \
                       --estimator at most";
        return Err(CliError::input(message));
    }
    let estimator = args.estimator.first().map(|name| choice::estimator(name, "--estimator"));
    let (planner, estimator) = (args.planning.named(), estimator.transpose()?);
    fleets::run(planner.as_ref(), estimator.as_ref(), args.runs, args.seed, jobs, output)
}

fn run_planners(args: &Args, jobs: usize, output: Output) -> Result<(), CliError> {
    if args.estimator.len() > 1 {
        let message = "planners are compared with one --estimator, or with the scenarios' own";
        return Err(CliError::input(message));
    }
    let mut hunts = Vec::new();
    for name in PLANNER_SCENARIOS {
        let mut scenario = choice::scenario(name)?;
        tell(args, &mut scenario)?;
        let asked = args.estimator.first().map(String::as_str);
        let estimator = choice::estimator_of(asked, &scenario, name)?;
        hunts.push((scenario, args.overrides.apply(estimator)));
    }
    planners::run(&hunts, &args.planning.compared(), args.runs, args.seed, jobs, output)
}

fn run_trial(args: &Args, trial: &Trial, jobs: usize, output: Output) -> Result<(), CliError> {
    let given = [
        args.overrides.any(),
        args.calibration.is_given(),
        args.extraction.any(),
        args.planning.is_given(),
    ];
    if given.contains(&true) {
        let flags = "--components, --prior-sigma-m, --power-sigma-db, --bearing-sigma-deg, --lag-s, --calibration, \
                     --extractor, --antenna and --planner";
        return Err(CliError::input(format!(
            "{flags} are of flown hunts; {} is a trial",
            trial.name
        )));
    }
    let estimators = if args.estimator.is_empty() {
        let place = format!("{}: estimator", args.scenario);
        vec![choice::trial_estimator(&trial.estimator, &place)?]
    } else {
        let named = |name| choice::trial_estimator(name, "--estimator");
        asked(args).into_iter().map(named).collect::<Result<_, _>>()?
    };
    let runs = u64::from(args.runs) * u64::try_from(estimators.len()).unwrap_or(u64::MAX);
    let progress = Progress::new("runs", runs);
    let report =
        trial_campaign(trial, &estimators, args.runs, args.seed, jobs, &|| progress.step());
    progress.finish();
    output.result(&report.map_err(choice::trial_error)?, tables)
}

/// The names that were asked for, each once.
fn asked(args: &Args) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for name in &args.estimator {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    names
}

/// The estimators that were asked for, or else the scenario's own.
fn estimators(args: &Args, scenario: &Scenario) -> Result<Vec<NamedEstimator>, CliError> {
    if args.estimator.is_empty() {
        return Ok(vec![choice::estimator_of(None, scenario, &args.scenario)?]);
    }
    asked(args).into_iter().map(|name| choice::estimator(name, "--estimator")).collect()
}

/// What the columns mean, for those who read the tables the first time.
const LEGEND: &str = "Errors in metres. A consistent estimator's ANEES lies in the interval with \
     95 %, and 95 % of its\nellipses hold the truth; an over-confident one has a larger ANEES and \
     holds fewer. Too few\nare runs in which a covariance 1.5 times too small would not be \
     noticed. To 3 m:\nthe median number of steps until the ellipse's semi-major axis is below 3 m, a dash \
     where more than\nhalf of the runs never get there; path: the median of what all drones flew together.";

/// One table for each beacon.
fn tables(report: &CampaignReport) -> String {
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
        lines.extend(checkpoints(report, index));
    }
    lines.push(LEGEND.to_owned());
    lines.join("\n")
}

/// The root mean square errors on the way, where the scenario asks for them.
fn checkpoints(report: &CampaignReport, index: usize) -> Option<String> {
    let beacons = || report.estimators.iter().filter_map(|e| Some((e, e.beacons.get(index)?)));
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
    let error =
        |pick: fn(&foxhunt::campaign::Spread) -> f64| number(beacon.error_m.as_ref().map(pick), 2);
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
