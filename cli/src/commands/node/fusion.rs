use std::{fs, path::PathBuf};

use foxhunt::{
    hardware::link::UnixTime,
    hunt::{Event, Fix},
    log::Log,
    network::{FusionNode, FusionNodeConfig, Past},
    picture::hunt_svg,
    registry::{EstimatorEntry, Registry},
    scenario::Scenario,
    simulation::Setup,
};
use serde::Serialize;

use super::{
    log::NodeLog,
    over::{Failures, Shared, Stop},
};
use crate::{
    commands::{choice, fixes, notices::Notices},
    context::Context,
    error::CliError,
    output::{Output, warn},
};

/// Run the fusing part: receive the drones' reports, estimate, plan, and send the drones orders
///
/// Begins when all drones report and ends when all searches are over. Stopped and started again
/// with --resume, it goes on from its log, and every estimate is the same as without the stop.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A built-in scenario or a TOML file; of its world, only the number of drones is used
    scenario: String,
    /// The seed of estimators that draw random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// The estimator; the scenario's own unless given
    #[arg(long, value_name = "NAME")]
    estimator: Option<String>,
    /// Where the log is written to
    #[arg(long, value_name = "FILE", default_value = "out/hunt.jsonl")]
    log: PathBuf,
    /// Go on from the log if it is there
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    shared: Shared,
}

pub(super) fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry } = context;
    let scenario = choice::scenario(&args.scenario)?;
    let past_log = NodeLog::read(&args.log, args.resume)?;
    let (stop, clock) = (Stop::listen()?, args.shared.clock());
    let (mut log, estimator, past) = match past_log {
        Some(log) => resumed(args, &scenario, registry, log)?,
        None => {
            let given = args.estimator.as_deref();
            let estimator =
                choice::estimator_of(registry, given, &scenario, &args.scenario)?.clone();
            let setup = Setup { scenario: &scenario, estimator: &estimator, registry };
            let mut header = setup.log_header(args.seed);
            header.epoch_unix_s = Some(clock.unix()?.sec);
            (NodeLog::new(&args.log, header), estimator, None)
        }
    };
    let epoch = UnixTime::whole(log.header.epoch_unix_s.unwrap_or_default());
    let drones = scenario.world.drones.len();
    let parts = scenario.parts(registry, &estimator, log.header.seed).map_err(CliError::input)?;
    let hunt =
        parts.build().map_err(|error| choice::simulation_error(error.into(), &args.scenario))?;
    let link = args.shared.fusion(drones)?;
    let mut node = FusionNode::new(hunt, drones, link, epoch, past, FusionNodeConfig::default())
        .map_err(CliError::failure)?;
    let (mut failures, mut waiting) = (Failures::default(), Vec::new());
    let mut notices = Notices::default();
    while stop.goes_on() {
        let time = clock.unix()?.since(epoch);
        failures.report(node.step(time))?;
        if node.homes().is_empty() {
            let silent = node.silent(time);
            if silent != waiting && !silent.is_empty() {
                warn(&format!("waits for drones {silent:?}, counted from 0"));
            }
            waiting = silent;
        } else if log.header.homes.is_empty() {
            log.header.homes = node.homes().to_vec();
        }
        while let Some(event) = node.poll_event() {
            notices.print(&event);
            log.event(event)?;
        }
        if node.is_finished(time) {
            return report(args, &log, node.hunt().fixes(), output);
        }
    }
    warn(&format!("stopped; it goes on with --resume --log {}", args.log.display()));
    Ok(())
}

/// The hunt of an earlier log: the log, its estimator, and what happened in it.
fn resumed(
    args: &Args,
    scenario: &Scenario,
    registry: &Registry,
    log: Log,
) -> Result<(NodeLog, EstimatorEntry, Option<Past>), CliError> {
    let file = args.log.display();
    if log.header.scenario != scenario.name {
        let logged = &log.header.scenario;
        let message = format!("{file} is a log of {logged}, not of {}", scenario.name);
        return Err(CliError::input(message));
    }
    if log.header.epoch_unix_s.is_none() {
        return Err(CliError::input(format!("{file} has no epoch_unix_s: no node wrote it")));
    }
    let name = &log.header.estimator_name;
    let estimator = match log.header.estimator {
        Some(settings) => EstimatorEntry::of_settings(name.clone(), "as logged", "", settings),
        None => choice::estimator(registry, name, &file.to_string())?.clone(),
    };
    warn(&format!("goes on from {file}, {} events", log.events.len()));
    let past = Past { homes: log.header.homes.clone(), events: log.events.clone() };
    Ok((NodeLog::append(&args.log, log)?, estimator, Some(past)))
}

/// The result of the hunt.
#[derive(Serialize)]
struct Report<'a> {
    fixes: &'a [Fix],
    receptions: usize,
}

fn report(args: &Args, log: &NodeLog, fixes: &[Fix], output: Output) -> Result<(), CliError> {
    let picture = args.log.with_extension("svg");
    let svg = hunt_svg(&log.header, &log.events).map_err(CliError::failure)?;
    fs::write(&picture, svg).map_err(|error| CliError::writing(&picture, error))?;
    let received = |event: &&Event| matches!(event, Event::Received { .. });
    let report = Report { fixes, receptions: log.events.iter().filter(received).count() };
    output.result(&report, |report| {
        format!("{}\n{}", fixes::fixes(report.fixes.iter().map(row)), fixes::LEGEND)
    })?;
    output.note(&format!("log: {}\npicture: {}", args.log.display(), picture.display()))
}

fn row(fix: &Fix) -> fixes::Row<'_> {
    fixes::Row {
        beacon: &fix.name,
        estimate: (&fix.estimate).into(),
        ellipse_95: fix.estimate.ellipse(0.95),
        error_m: None,
        nees: None,
        steps: fix.steps,
        outcome: fix.outcome.to_string(),
    }
}
