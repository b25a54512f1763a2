//! The fusion node: the hunt itself, and its log.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, IsTerminal},
    path::{Path, PathBuf},
};

use foxhunt::{
    hardware::link::{FusionLink, Stage, UnixTime},
    hunt::{Event, Fix},
    log::{Log, LogHeader, LogWriter},
    network::{FusionNode, FusionNodeConfig, Past},
    overview::Overview,
    page::PageLog,
    picture::hunt_svg,
    registry::{EstimatorEntry, Registry},
    struck::Struck,
};
use serde::Serialize;

use super::{
    field::Field,
    over::{Failures, Shared, Stop, rest},
};
use crate::{
    commands::{
        choice, fixes,
        fly::{Pilot, PilotInput, platforms},
        live::{LiveArgs, LiveView, Shown},
        notices::Notices,
        views::write_page,
    },
    error::CliError,
    output::{Context, Output, warn},
};

/// The log that a fusion node writes, and goes on from.
struct NodeLog {
    path: PathBuf,
    writer: Option<LogWriter<File>>,
    header: LogHeader,
    events: Vec<Event>,
}

impl NodeLog {
    /// A log that begins with its first event.
    fn new(path: &Path, header: LogHeader) -> Self {
        Self { path: path.to_owned(), writer: None, header, events: Vec::new() }
    }

    /// Reads the log, if it exists; without `resume` it must not exist.
    fn read(path: &Path, resume: bool) -> Result<Option<Log>, CliError> {
        match fs::metadata(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Ok(_) if !resume => Err(CliError::input(format!(
                "{} exists: resume it with --resume, or name another one with --log",
                path.display()
            ))),
            _ => Log::read(path).map(Some).map_err(CliError::input),
        }
    }

    /// Appends to a log that was read.
    fn append(path: &Path, log: Log) -> Result<Self, CliError> {
        let writer = LogWriter::append(path).map_err(|error| CliError::writing(path, error))?;
        let Log { header, events, .. } = log;
        Ok(Self { path: path.to_owned(), writer: Some(writer), header, events })
    }

    /// Writes an event.
    fn event(&mut self, event: Event) -> Result<(), CliError> {
        self.write(&event).map_err(|error| CliError::writing(&self.path, error))?;
        self.events.push(event);
        Ok(())
    }

    fn write(&mut self, event: &Event) -> io::Result<()> {
        if self.writer.is_none() {
            if let Some(folder) = self.path.parent() {
                fs::create_dir_all(folder)?;
            }
            let file = OpenOptions::new().write(true).create_new(true).open(&self.path)?;
            self.writer = Some(LogWriter::new(file, &self.header)?);
        }
        self.writer.as_mut().map_or(Ok(()), |writer| writer.event(event))
    }
}

/// Run the fusing part: receive the drones' reports, estimate, plan, and send the drones orders
///
/// Begins when all drones report and ends when all searches are over. Stopped and started again
/// with --resume, it goes on from its log, and every estimate is the same as without the stop.
///
/// With a flight's file the drones are real ones: it waits until all are ready, and for Enter,
/// which lets them take off. Enter in the air breaks off: all leave by flight.on_abort. Ctrl-C
/// stops this node alone: the drones hold, and leave by flight.on_abort after
/// flight.orders_timeout_s.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A flight's TOML file, the same on all computers; or a built-in scenario or its TOML file,
    /// for simulated drones
    field: String,
    /// Let real drones take off without asking
    #[arg(long)]
    yes: bool,
    /// The seed of estimators that draw random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// The estimator [default: the scenario's own]
    #[arg(long, value_name = "NAME")]
    estimator: Option<String>,
    /// The file of the log
    #[arg(long, value_name = "FILE", default_value = "out/hunt.jsonl")]
    log: PathBuf,
    /// Resume from the log if it exists
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    live: LiveArgs,
    #[command(flatten)]
    shared: Shared,
}

/// Operator who stops the node.
enum Operator {
    /// A pilot at the keyboard.
    Pilot(Pilot),
    Signals(Stop),
}

impl Operator {
    fn poll(&self) -> PilotInput {
        match self {
            Self::Pilot(pilot) => pilot.poll(),
            Self::Signals(stop) if stop.count() > 0 => PilotInput::Interrupt,
            Self::Signals(_) => PilotInput::None,
        }
    }
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    let field = Field::find(&args.field)?;
    let confirms = field.is_flown() && !args.yes;
    if confirms && !io::stdin().is_terminal() {
        return Err(CliError::input(
            "standard input is not a terminal, so the take-off cannot be confirmed; use --yes to \
             take off without asking",
        ));
    }
    let live = match &field {
        Field::Flown(flight) => args.live.plan_of(flight.cot.as_ref(), &args.field)?,
        Field::Simulated(_) => args.live.plan()?,
    };
    let past_log = NodeLog::read(&args.log, args.resume)?;
    let operator = match field.is_flown() {
        true => Operator::Pilot(Pilot::listen()?),
        false => Operator::Signals(Stop::listen()?),
    };
    let clock = args.shared.clock();
    let (mut log, estimator, past) = match past_log {
        Some(log) => resumed(args, &field, registry, log)?,
        None => {
            let given = args.estimator.as_deref();
            let estimator = field.estimator(registry, given, &args.field)?.clone();
            let header = field.log_header(registry, &estimator, args.seed, clock.unix()?.sec);
            (NodeLog::new(&args.log, header), estimator, None)
        }
    };
    let platforms = match &field {
        Field::Flown(flight) => platforms(flight),
        Field::Simulated(_) => Vec::new(),
    };
    let shown = Shown {
        header: &log.header,
        registry,
        estimator: &estimator,
        extractor: field.extractor(),
        platforms: &platforms,
        orders: true,
        nowhere: "the scenario's hunt is in local metres; a flight's file has its place on \
                  Earth in [site]",
        is_simulated: false,
    };
    let live = live.map(|plan| LiveView::start(plan, &shown)).transpose()?;
    if let Some(live) = &live {
        log.events.iter().for_each(|event| live.show(event, &[]));
    }
    let epoch = UnixTime::whole(log.header.epoch_unix_s.unwrap_or_default());
    let hunt = field.hunt(registry, &estimator, log.header.seed, &args.field)?;
    let drones = field.drones();
    let config = FusionNodeConfig::default();
    let link = args.shared.fusion(drones)?;
    let mut node =
        FusionNode::new(hunt, drones, link, epoch, past, config).map_err(CliError::failure)?;
    node.wait_for_go(confirms);
    let mut failures = Failures::default();
    let mut waiting = Waiting::default();
    let mut notices = Notices::default();
    loop {
        let time = clock.unix()?.since(epoch);
        failures.report(node.step(time))?;
        if let Some(live) = &live {
            live.place(time, || node.hunt().stations());
        }
        if node.homes().is_empty() {
            waiting.report(&node, time);
        } else if log.header.homes.is_empty() {
            log.header.homes = node.homes().to_vec();
        }
        while let Some(event) = node.poll_event() {
            notices.print(&event);
            notices.print_receivers(&event, node.hunt(), |_| None);
            if let Some(live) = &live {
                live.show(&event, &[]);
            }
            log.event(event)?;
        }
        if node.is_finished(time) {
            break;
        }
        if live.as_ref().is_some_and(LiveView::is_broken_off) {
            warn("the drones leave");
            node.abort(time, "broken off in the live view").map_err(CliError::failure)?;
        }
        match operator.poll() {
            PilotInput::None => rest(),
            PilotInput::Enter if node.is_ready() => node.go(),
            PilotInput::Up => warn("a drone of a node is cleared by its mode, at its transmitter"),
            PilotInput::Enter => {
                warn("the drones leave");
                node.abort(time, "the pilot breaks off").map_err(CliError::failure)?;
            }
            PilotInput::Interrupt | PilotInput::Quit => {
                let hold = if field.is_flown() { "the drones hold; " } else { "" };
                let path = args.log.display();
                warn(&format!("stopped; {hold}it goes on with --resume --log {path}"));
                return Ok(());
            }
        }
    }
    notices.finish();
    let log = Log { header: log.header, events: log.events, torn: false };
    report(args, &log, node.hunt().fixes(), output)?;
    page(args, &log, registry, &estimator, output)?;
    if let Some(live) = live {
        live.stay(|| {
            !matches!(operator.poll(), PilotInput::None | PilotInput::Enter | PilotInput::Up)
        });
    }
    match node.failure() {
        Some(why) => Err(CliError::failure(why)),
        None => Ok(()),
    }
}

/// Conditions that the hunt waits for, each reported once.
#[derive(Default)]
struct Waiting {
    text: String,
}

impl Waiting {
    fn report<L: FusionLink>(&mut self, node: &FusionNode<L>, time: f64) {
        let silent = node.silent(time);
        let stages = node.stages().enumerate();
        let waited_for = stages.filter_map(|(drone, (stage, why))| match stage {
            _ if silent.contains(&drone) => Some(format!("drone {drone} is silent")),
            Stage::Flying | Stage::Ready => None,
            stage if why.is_empty() => Some(format!("drone {drone} {stage}")),
            stage => Some(format!("drone {drone} {stage}: {why}")),
        });
        let waited_for: Vec<String> = waited_for.collect();
        let text = match (waited_for.is_empty(), node.is_ready()) {
            (true, true) => "all drones are ready: Enter takes off, Ctrl-C stops".to_owned(),
            (true, false) => return,
            (false, _) => format!("waits; counted from 0, {}", waited_for.join(", ")),
        };
        if text != self.text {
            warn(&text);
            self.text = text;
        }
    }
}

/// The hunt of an earlier log: the log, its estimator, and what happened in it.
fn resumed(
    args: &Args,
    field: &Field,
    registry: &Registry,
    log: Log,
) -> Result<(NodeLog, EstimatorEntry, Option<Past>), CliError> {
    let file = args.log.display();
    if log.header.scenario != field.name() {
        let logged = &log.header.scenario;
        let message = format!("{file} is a log of {logged}, not of {}", field.name());
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

fn report(args: &Args, log: &Log, fixes: &[Fix], output: Output) -> Result<(), CliError> {
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

/// The page of the hunt, beside the log.
fn page(
    args: &Args,
    log: &Log,
    registry: &Registry,
    estimator: &EstimatorEntry,
    output: Output,
) -> Result<(), CliError> {
    let struck = Struck::default();
    let (overview, _) = Overview::of_log(log, registry, Some(estimator), &struck, Vec::new(), None)
        .map_err(CliError::failure)?;
    let page_log = PageLog::new(&log.header, None, &log.events);
    let file = args.log.with_extension("html");
    write_page(&file, &overview, Some(&page_log), args.live.map()?.as_ref())?;
    output.note(&format!("report: {}", file.display()))
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
