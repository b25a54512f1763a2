//! Random flights and recordings for hours.

mod drawn;
mod recordings;
mod runs;
mod usage;
mod world;

use std::{
    convert::Infallible,
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use clap::value_parser;
#[cfg(all(unix, feature = "hardware"))]
use foxhunt::fly::EmulatedFlight;
use foxhunt::{
    Experiment, Runner, document,
    registry::Registry,
    scenario::Scenario,
    soak::{SoakFailure, SoakFlight},
};
use serde::Serialize;

use self::{
    recordings::BentRecording,
    runs::{Kind, Tally, fly_simulated},
    usage::Memory,
    world::World,
};
use crate::{
    error::CliError,
    output::{Context, Output, event},
    progress::Progress,
    table::table,
};

/// Fly random hunts for hours and check invariants
///
/// Each seed draws a fleet with everything that may go wrong, beacons, estimator, extractor,
/// antenna and planner, and flies it twice; every fourth one draws a recording instead, bends and
/// cuts it, and locates with it; with the feature `hardware` every eighth one flies emulated
/// devices whose cables, links and autopilots fail. Checks that each search has an end or a reason,
/// that drones keep separation, airspace and batteries, that estimates are finite and their
/// covariances positive definite, that flight and replay repeat to the bit, that logs are read
/// wherever they are cut off, and that memory does not grow. With --recordings it draws recordings
/// as people make them and judges the estimators instead (docs/judging.md). The exit code is 1 if a
/// check failed; the folder then has the files that show the failure again.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt soak --hours 8\n  \
                        foxhunt soak --runs 1000 --seed 5000\n  \
                        foxhunt soak --again soak/7.toml --seed 7\n  \
                        foxhunt soak --recordings --runs 200 --write worst")]
#[command(group = clap::ArgGroup::new("length").required(true))]
pub struct Args {
    /// Run for this time, in hours
    #[arg(long, value_name = "H", group = "length")]
    hours: Option<f64>,
    /// Run this many runs
    #[arg(long, value_name = "N", group = "length")]
    runs: Option<u64>,
    /// Run one flight of a scenario's file, or one recording (.csv), such as an earlier soak left
    #[arg(long, value_name = "FILE", group = "length")]
    again: Option<PathBuf>,
    /// The seed of the first run; run i has this plus i
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// The number of runs at the same time [default: the number of processors]
    #[arg(long, value_name = "J", value_parser = value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Print no progress on standard error
    #[arg(long)]
    quiet: bool,
    /// The folder for the smallest scenario of each failure
    #[arg(long, value_name = "DIR", default_value = "soak")]
    out: PathBuf,
    #[command(flatten)]
    world: World,
}

/// Results of a soak.
#[derive(Debug, Default, Serialize)]
struct Report {
    /// The seed of the first run.
    seed: u64,
    /// Simulated flights, each flown twice.
    flights: u64,
    /// Flights that could not begin or go on and gave a reason.
    refused: u64,
    /// Searches that ended.
    searches: u64,
    /// Checked estimates.
    estimates: u64,
    /// Estimates that were replayed from the logs.
    replayed: u64,
    /// The size of all logs.
    log_bytes: u64,
    /// Flights of emulated devices with faults of cables, links and autopilots.
    device_flights: u64,
    /// Recordings that were drawn and bent.
    recordings: u64,
    /// Recordings that could be read.
    read: u64,
    /// Places that were found in them.
    located: u64,
    /// Maximum memory that the program held, in mebibytes; absent if unknown.
    most_memory_mib: Option<f64>,
    /// Runs that failed.
    failures: Vec<Failed>,
}

/// A run in which a check failed.
#[derive(Debug, Serialize)]
struct Failed {
    /// Seed of the run.
    seed: u64,
    /// Failed check.
    what: String,
    /// The command that shows it again.
    again: String,
}

/// The runs of a soak.
struct Soak<'a> {
    registry: &'a Registry,
}

impl Experiment for Soak<'_> {
    type Run = Tally;
    type Error = Infallible;

    fn run(&self, seed: u64) -> Result<Tally, Infallible> {
        let registry = self.registry;
        Ok(match Kind::of(seed) {
            Kind::Recording { .. } => BentRecording::draw(seed).locate(registry),
            #[cfg(all(unix, feature = "hardware"))]
            Kind::Devices => runs::fly_devices(&EmulatedFlight::draw(seed), registry),
            Kind::Flight => fly_simulated(&SoakFlight::draw(registry, seed), registry),
        })
    }
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    if let Some(path) = args.again.as_ref().filter(|_| !args.world.recordings) {
        return again(path, args.seed, registry, output);
    }
    let jobs = match args.jobs {
        Some(jobs) => usize::from(jobs),
        None => std::thread::available_parallelism().map_or(1, usize::from),
    };
    let runner = Runner::new(jobs).map_err(CliError::failure)?;
    if args.world.recordings {
        let why = "--recordings needs --runs, the number of draws of each class";
        let runs = args.runs.ok_or_else(|| CliError::input(why))?;
        let draws = (runs, args.seed, &runner);
        return world::run(&args.world, draws, registry, output, !args.quiet);
    }
    let most = args.hours.map(|hours| Duration::try_from_secs_f64(3600.0 * hours));
    let most = most.transpose().map_err(|error| CliError::input(format!("--hours: {error}")))?;
    let begun = Instant::now();
    let runs = args.runs.unwrap_or(u64::MAX);
    let is_on = |_: &u64| most.is_none_or(|most| begun.elapsed() < most);
    let seeds = (0..runs).map(|run| args.seed.wrapping_add(run)).take_while(is_on);

    let mut report = Report { seed: args.seed, ..Report::default() };
    let mut memory = Memory::default();
    let (what, length) = match (most, args.runs) {
        (Some(most), _) => ("seconds", most.as_secs()),
        (None, runs) => ("runs", runs.unwrap_or(0)),
    };
    let progress = Progress::new(output, what, length, !args.quiet);
    let mut runs_done = 0;
    runner.run_seeds(&Soak { registry }, seeds, &|| (), |done| {
        for (seed, tally) in done {
            let known = report.failures.len();
            if let Some(grown) = memory.grown(jobs) {
                report.failures.push(Failed {
                    seed,
                    what: format!("memory: {grown}"),
                    again: format!("foxhunt soak --runs 2000 --seed {}", args.seed),
                });
            }
            for failure in &tally.failures {
                let failed = keep(seed, failure, registry, &args.out)?;
                progress.warn(&format!("seed {seed}: {failure}\n  {}", failed.again));
                report.failures.push(failed);
            }
            if output.streams() {
                for failed in report.failures.iter().skip(known) {
                    event("failure", failed).map_err(CliError::printing)?;
                }
            }
            report.add(&tally);
            runs_done += 1;
        }
        progress.reach(most.map_or(runs_done, |_| begun.elapsed().as_secs().min(length)));
        progress.note(format!(
            "{what}, {} flights, {} recordings, {} failures",
            report.flights,
            report.recordings,
            report.failures.len()
        ));
        Ok::<_, CliError>(())
    })?;
    progress.finish();
    report.most_memory_mib = memory.most_mib();
    finish(&report, output)
}

impl Report {
    fn add(&mut self, tally: &Tally) {
        match tally.kind {
            Kind::Recording { is_read } => {
                self.recordings += 1;
                self.read += u64::from(is_read);
                self.located += tally.located;
            }
            #[cfg(all(unix, feature = "hardware"))]
            Kind::Devices => self.device_flights += 1,
            Kind::Flight => self.flights += 1,
        }
        self.refused += u64::from(tally.refused);
        self.searches += tally.searches;
        self.estimates += tally.estimates;
        self.replayed += tally.replayed;
        self.log_bytes += tally.log_bytes;
    }
}

/// Writes the files that show a failure again, as small as they get.
fn keep(
    seed: u64,
    failure: &SoakFailure,
    registry: &Registry,
    out: &Path,
) -> Result<Failed, CliError> {
    fs::create_dir_all(out).map_err(|error| CliError::writing(out, error))?;
    let fails = |tally: &Tally| tally.failures.iter().any(|other| other.kind == failure.kind);
    let (file, text, again) = match Kind::of(seed) {
        Kind::Recording { .. } => {
            let fails = |recording: &BentRecording| fails(&recording.locate(registry));
            let recording = BentRecording::draw(seed).minimal(fails);
            let file = out.join(format!("{seed}.csv"));
            let again = again_with(&file, seed);
            (file, recording.into_text(), again)
        }
        #[cfg(all(unix, feature = "hardware"))]
        Kind::Devices => {
            let fails = |flight: &EmulatedFlight| fails(&runs::fly_devices(flight, registry));
            let flight = runs::minimal(EmulatedFlight::draw(seed), fails);
            let text = document::to_toml(&flight.field).map_err(CliError::failure)?;
            let again = format!("foxhunt soak --runs 1 --seed {seed}");
            (out.join(format!("{seed}.toml")), text.into_bytes(), again)
        }
        Kind::Flight => {
            let fails = |flight: &SoakFlight| fails(&fly_simulated(flight, registry));
            let SoakFlight { scenario, .. } = SoakFlight::draw(registry, seed).minimal(fails);
            let text = document::to_toml(&scenario).map_err(CliError::failure)?;
            let file = out.join(format!("{seed}.toml"));
            let again = again_with(&file, seed);
            (file, text.into_bytes(), again)
        }
    };
    fs::write(&file, text).map_err(|error| CliError::writing(&file, error))?;
    Ok(Failed { seed, what: failure.to_string(), again })
}

/// The command that shows a failure again.
fn again_with(file: &Path, seed: u64) -> String {
    format!("foxhunt soak --again {} --seed {seed}", file.display())
}

/// Flies one scenario, or locates with one recording, as a soak does.
fn again(path: &Path, seed: u64, registry: &Registry, output: Output) -> Result<(), CliError> {
    let tally = if path.extension().is_some_and(|end| end == "csv") {
        let unread = |error| CliError::failure(format!("{}: {error}", path.display()));
        let text = fs::read(path).map_err(unread)?;
        BentRecording::again(text, seed).locate(registry)
    } else {
        let scenario = Scenario::find(&path.to_string_lossy()).map_err(CliError::input)?;
        fly_simulated(&SoakFlight { scenario, seed }, registry)
    };
    let mut report = Report { seed, ..Report::default() };
    report.add(&tally);
    let again = again_with(path, seed);
    report.failures = tally
        .failures
        .iter()
        .map(|failure| Failed { seed, what: failure.to_string(), again: again.clone() })
        .collect();
    finish(&report, output)
}

/// Prints the counts; a failure if a check failed.
fn finish(report: &Report, output: Output) -> Result<(), CliError> {
    output.result(report, text)?;
    match report.failures.len() {
        0 => Ok(()),
        1 => Err(CliError::failure("1 check failed")),
        count => Err(CliError::failure(format!("{count} checks failed"))),
    }
}

fn text(report: &Report) -> String {
    let mut counts = table(&["what", "count"]);
    for (what, count) in [
        ("flights, each flown twice", report.flights),
        ("of them refused with a reason", report.refused),
        ("searches that ended", report.searches),
        ("estimates looked at", report.estimates),
        ("estimates replayed", report.replayed),
        ("bytes of logs", report.log_bytes),
        ("flights of emulated devices", report.device_flights),
        ("recordings bent and cut", report.recordings),
        ("of them read", report.read),
        ("places located in them", report.located),
        ("failures", u64::try_from(report.failures.len()).unwrap_or(u64::MAX)),
    ] {
        counts.add_row([what.to_owned(), count.to_string()]);
    }
    let mut lines = vec![format!("Soak, seeds from {}", report.seed), counts.to_string()];
    lines.extend(report.most_memory_mib.map(|most| format!("At most {most:.0} MiB of memory.")));
    for Failed { seed, what, again } in &report.failures {
        lines.push(format!("seed {seed}: {what}\n  {again}"));
    }
    lines.join("\n")
}
