use std::{fs, path::PathBuf};

use foxhunt::{
    config::NamedEstimator,
    hardware::link::UnixTime,
    hunt::{Event, Fix},
    log::Log,
    network::{FusionNode, FusionNodeConfig, Past},
    picture::hunt_svg,
    scenario::Scenario,
    simulation::log_header,
};
use serde::Serialize;

use super::{
    log::NodeLog,
    over::{Failures, Shared, Stop},
};
use crate::{
    commands::{choice, fixes, telling},
    error::CliError,
    output::{Output, warn},
};

/// Run the fusing part: take what the drones report, estimate, plan, and tell them where to go
///
/// Begins when all drones have shown up and ends when all beacons are done. Stopped and started
/// again with --resume, it goes on from its log, and no estimate is another one for it.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// What is hunted and how: a built-in scenario or a TOML file, of which the world is not looked
    /// at but for the number of drones
    scenario: String,
    /// The seed of estimators that draw random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// The estimator; the scenario's own unless given
    #[arg(long, value_name = "NAME", value_parser = choice::estimator_parser())]
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

pub(super) fn run(args: &Args, output: Output) -> Result<(), CliError> {
    let scenario = choice::scenario(&args.scenario)?;
    let there = NodeLog::there(&args.log, args.resume)?;
    let (stop, clock) = (Stop::listen()?, args.shared.clock());
    let (mut log, estimator, past) = match there {
        Some(log) => resumed(args, &scenario, log)?,
        None => {
            let asked = args.estimator.as_deref();
            let estimator = choice::estimator_of(asked, &scenario, &args.scenario)?;
            let mut header = log_header(&scenario, &estimator, args.seed);
            header.epoch_unix_s = Some(clock.unix()?.sec);
            (NodeLog::new(&args.log, header), estimator, None)
        }
    };
    let epoch = UnixTime::whole(log.header.epoch_unix_s.unwrap_or_default());
    let drones = scenario.world.drones.len();
    let parts = scenario.parts(&estimator.config, log.header.seed);
    let hunt =
        parts.build().map_err(|error| choice::simulation_error(error.into(), &args.scenario))?;
    let link = args.shared.fusion(drones)?;
    let mut node = FusionNode::new(hunt, drones, link, epoch, past, FusionNodeConfig::default())
        .map_err(CliError::failure)?;
    let (mut failures, mut waiting) = (Failures::default(), Vec::new());
    while stop.goes_on() {
        let time = clock.unix()?.since(epoch);
        failures.bear(node.step(time))?;
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
            telling::tell(&event);
            log.event(event)?;
        }
        if node.is_finished(time) {
            return report(args, &log, node.hunt().fixes(), output);
        }
    }
    warn(&format!("stopped; it goes on with --resume --log {}", args.log.display()));
    Ok(())
}

/// What a log that is there tells of the hunt to go on with.
fn resumed(
    args: &Args,
    scenario: &Scenario,
    log: Log,
) -> Result<(NodeLog, NamedEstimator, Option<Past>), CliError> {
    let file = args.log.display();
    if log.header.scenario != scenario.name {
        let (logged, asked) = (&log.header.scenario, &scenario.name);
        return Err(CliError::input(format!("{file} is a log of {logged}, not of {asked}")));
    }
    if log.header.epoch_unix_s.is_none() {
        return Err(CliError::input(format!("{file} has no epoch_unix_s: no node wrote it")));
    }
    let mut estimator = choice::estimator(&log.header.estimator_name, &file.to_string())?;
    estimator.config = log.header.estimator;
    warn(&format!("goes on from {file}, {} events", log.events.len()));
    let past = Past { homes: log.header.homes.clone(), events: log.events.clone() };
    Ok((NodeLog::append(&args.log, log)?, estimator, Some(past)))
}

/// What the hunt came to.
#[derive(Serialize)]
struct Report<'a> {
    fixes: &'a [Fix],
    receptions: usize,
}

fn report(args: &Args, log: &NodeLog, fixes: &[Fix], output: Output) -> Result<(), CliError> {
    let picture = args.log.with_extension("svg");
    let svg = hunt_svg(&log.header, &log.events).map_err(CliError::failure)?;
    fs::write(&picture, svg).map_err(|error| CliError::writing(&picture, error))?;
    let heard = |event: &&Event| matches!(event, Event::Received { .. });
    let report = Report { fixes, receptions: log.events.iter().filter(heard).count() };
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
