//! Figures of logs.

use std::path::{Path, PathBuf};

use foxhunt::{
    formation::Phase,
    hunt::Event,
    log::{Log, LogError},
    overview::{Overview, SearchOverview},
    picture::{
        Graph, NamedSearch, axes_over_steps, clouds_svg, error_over_steps, graph_svg, hunt_svg,
        nees_over_steps, phases_svg,
    },
    struck::Struck,
};

use super::drawing::Drawing;
use crate::{
    commands::choice,
    error::{CliError, InFile},
    output::{Context, Output, warn_once},
};

/// Replay of logs.
#[derive(Debug, clap::Args)]
struct Replaying {
    /// Replay the logs through this estimator [default: their own]
    #[arg(long, value_name = "NAME")]
    estimator: Option<String>,
    /// The beacon, if a hunt has several [default: all]
    #[arg(long, value_name = "NAME")]
    beacon: Option<String>,
}

/// One log.
#[derive(Debug, clap::Args)]
pub struct OneLog {
    /// A log, such as `foxhunt hunt` writes it
    log: PathBuf,
    #[command(flatten)]
    replaying: Replaying,
    #[command(flatten)]
    drawing: Drawing,
}

/// Several logs.
#[derive(Debug, clap::Args)]
pub struct Logs {
    /// Logs, such as `foxhunt hunt` writes them
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    #[command(flatten)]
    replaying: Replaying,
    #[command(flatten)]
    drawing: Drawing,
}

/// The state machine of a search.
#[derive(Debug, clap::Args)]
pub struct Machine {
    /// A log, whose hunt is drawn into the machine
    log: Option<PathBuf>,
    #[command(flatten)]
    drawing: Drawing,
}

fn read(path: &Path) -> Result<Log, CliError> {
    let log = Log::read(path).map_err(|error: LogError| CliError::input(error))?;
    if log.torn {
        warn_once(&format!("{}: the last line is cut short and left out", path.display()));
    }
    Ok(log)
}

impl Replaying {
    fn overview(&self, path: &Path, context: Context<'_>) -> Result<Overview, CliError> {
        let log = read(path)?;
        let registry = context.registry;
        let other = self.estimator.as_deref();
        let other = other.map(|name| choice::estimator(registry, name, "--estimator"));
        let replayed = Overview::of_log(
            &log,
            registry,
            other.transpose()?,
            &Struck::default(),
            Vec::new(),
            None,
        );
        let (overview, _) = replayed.map_err(|error| {
            let file = path.display().to_string();
            CliError::input(InFile { file, source: Box::new(error) })
        })?;
        Ok(overview)
    }

    /// The searches that are drawn, of all overviews.
    fn searches<'a>(&self, all: &'a [Overview]) -> Result<Vec<NamedSearch<'a>>, CliError> {
        let wanted = |search: &&SearchOverview| {
            self.beacon.as_ref().is_none_or(|beacon| *beacon == search.name)
        };
        let named = |overview: &'a Overview| {
            let seed = overview.seed.filter(|_| all.len() > 1);
            let more = seed.map_or_else(String::new, |seed| format!(", seed {seed}"));
            overview
                .searches
                .iter()
                .filter(wanted)
                .map(move |search| NamedSearch { name: format!("{}{more}", search.name), search })
        };
        let searches: Vec<_> = all.iter().flat_map(named).collect();
        if searches.is_empty() {
            let known = all.iter().flat_map(|overview| &overview.searches);
            let mut known: Vec<&str> = known.map(|search| search.name.as_str()).collect();
            known.sort_unstable();
            known.dedup();
            let what = self.beacon.as_deref().unwrap_or_default();
            let message = format!("--beacon {what}: the logs have {}", known.join(", "));
            return Err(CliError::input(message));
        }
        Ok(searches)
    }
}

/// Title of a hunt.
fn title(overview: &Overview) -> String {
    format!("{} · {}", overview.title, overview.method)
}

/// Function that draws a graph from a title and searches.
type Draw = fn(&str, &[NamedSearch<'_>]) -> Graph;

fn over_steps(args: &Logs, context: Context<'_>, draw: Draw) -> Result<(), CliError> {
    args.drawing.check()?;
    let read = |path: &PathBuf| args.replaying.overview(path, context);
    let overviews = args.logs.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    let searches = args.replaying.searches(&overviews)?;
    let title = args.drawing.title(&overviews.first().map_or_else(String::new, title));
    let graph = draw(&title, &searches);
    if graph.curves.iter().all(|curve| curve.points.is_empty()) {
        return Err(CliError::input("the logs hold nothing to draw: no truth, or no reception"));
    }
    args.drawing.write(graph_svg(&graph), context.output)
}

pub fn error(args: &Logs, context: Context<'_>) -> Result<(), CliError> {
    over_steps(args, context, error_over_steps)
}

pub fn axes(args: &Logs, context: Context<'_>) -> Result<(), CliError> {
    over_steps(args, context, axes_over_steps)
}

pub fn nees(args: &Logs, context: Context<'_>) -> Result<(), CliError> {
    over_steps(args, context, nees_over_steps)
}

pub fn trajectory(args: &OneLog, context: Context<'_>) -> Result<(), CliError> {
    args.drawing.check()?;
    let Replaying { estimator, beacon } = &args.replaying;
    for (flag, given) in [("--estimator", estimator), ("--beacon", beacon)] {
        if given.is_some() {
            let text = format!("{flag}: a trajectory shows the log's own, with all its beacons");
            return Err(CliError::input(text));
        }
    }
    let Log { mut header, events, .. } = read(&args.log)?;
    if let Some(title) = &args.drawing.title {
        header.scenario.clone_from(title);
    }
    args.drawing.write(hunt_svg(&header, &events), context.output)
}

pub fn phases(args: &Machine, output: Output) -> Result<(), CliError> {
    args.drawing.check()?;
    let log = args.log.as_deref().map(read).transpose()?;
    let phase = |event: &Event| match event {
        Event::PhaseChanged { phase, .. } => Some(*phase),
        _ => None,
    };
    let phases: Option<Vec<Phase>> =
        log.as_ref().map(|log| log.events.iter().filter_map(phase).collect());
    let own = log.map_or_else(
        || "Phases of a search".to_owned(),
        |log| format!("Phases of {}, with the number of times", log.header.scenario),
    );
    args.drawing.write(phases_svg(&args.drawing.title(&own), phases.as_deref()), output)
}

pub fn cloud(args: &OneLog, context: Context<'_>) -> Result<(), CliError> {
    args.drawing.check()?;
    let overview = args.replaying.overview(&args.log, context)?;
    let overviews = std::slice::from_ref(&overview);
    let searches = args.replaying.searches(overviews)?;
    let [only] = searches.as_slice() else {
        let names: Vec<&str> = searches.iter().map(|search| search.name.as_str()).collect();
        let message =
            format!("a cloud shows one beacon; choose with --beacon: {}", names.join(", "));
        return Err(CliError::input(message));
    };
    if only.search.beliefs.iter().all(|belief| belief.cloud.is_empty()) {
        let method = &overview.method;
        let message = format!("{method} has no cloud; use --estimator particle");
        return Err(CliError::input(message));
    }
    let own = format!("{} · {}", title(&overview), only.name);
    args.drawing.write(clouds_svg(&args.drawing.title(&own), only.search), context.output)
}
