use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
};

use foxhunt::{
    core::Remark,
    hunt::Event,
    log::{Log, LogHeader, LogWriter},
    overview::{KeptTurn, Overview},
    page::PageLog,
    picture::hunt_svg,
    report::{HuntReport, HuntedBeacon},
    scenario::DEFAULT_SCENARIO,
    simulation::{Setup, Simulated},
    struck::Struck,
};
use serde::Serialize;

use super::{
    choice, fixes,
    live::{LiveArgs, LiveView, PaceArgs, Shown},
    notices::Notices,
    settings::{Planning, Settings},
    tiles::NO_PLACE,
    views::{Antennas, Exports, keep_turns},
};
use crate::{
    error::CliError,
    output::{Context, check_writable},
};

/// Fly one simulated hunt
///
/// Flies the drones of a scenario through a simulated hunt for its beacons, one after the other or,
/// where turns are shared, all at once. Prints a table of fixes against the truth, and writes a
/// log, a picture and a page that shows the hunt in any browser. The same scenario, estimator and
/// seed fly the same hunt.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt hunt\n  \
                        foxhunt hunt pritzl-6.1 --estimator particle --seed 7 --out hunts/7\n  \
                        foxhunt hunt --planner waypoints\n  \
                        foxhunt hunt three-beacons --live --pace 5\n  \
                        foxhunt --json hunt my-field.toml > result.json")]
pub struct Args {
    /// A built-in scenario (`foxhunt list scenarios`) or a TOML file
    #[arg(default_value = DEFAULT_SCENARIO)]
    scenario: String,
    /// The seed of all random numbers
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// The estimator (`foxhunt list estimators` describes them) [default: the scenario's own]
    #[arg(long, value_name = "NAME")]
    estimator: Option<String>,
    #[command(flatten)]
    planning: Planning,
    #[command(flatten)]
    settings: Settings,
    #[command(flatten)]
    live: LiveArgs,
    #[command(flatten)]
    pace: PaceArgs,
    /// The folder for hunt.jsonl (the log), hunt.svg (the picture) and report.html (the page)
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    #[command(flatten)]
    exports: Exports,
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    args.exports.check(args.live.is_on_map())?;
    let mut scenario = choice::scenario(&args.scenario)?;
    args.settings.apply_to(&mut scenario, registry)?;
    args.planning.apply_to(&mut scenario, registry)?;
    let given = args.estimator.as_deref();
    let estimator = choice::estimator_of(registry, given, &scenario, &args.scenario)?;
    let estimator = args.settings.estimator(estimator)?;
    let setup = Setup { scenario: &scenario, estimator: &estimator, registry };
    let header = setup.log_header(args.seed);
    args.exports.check_known(header.origin.is_some(), header.epoch_unix_s.is_some())?;
    // A scenario is in local metres; the map is where the command line has it.
    let placed = LogHeader { origin: header.origin.or(args.exports.origin()), ..header.clone() };
    let shown = Shown {
        header: &placed,
        registry,
        estimator: &estimator,
        extractor: &scenario.extractor,
        platforms: &[],
        orders: false,
        nowhere: "the hunt is in local metres; --origin LAT,LON places it on Earth",
        is_simulated: true,
    };
    let tiles = args.live.map()?;
    if tiles.is_some() && placed.origin.is_none() {
        return Err(CliError::input(NO_PLACE));
    }
    let live = args.live.plan()?.map(|plan| LiveView::start(plan, &shown)).transpose()?;
    if live.is_none() && args.pace.is_given() {
        return Err(CliError::input("--pace: only with --live, --cot or --mqtt"));
    }
    fs::create_dir_all(&args.out).map_err(|error| CliError::writing(&args.out, error))?;
    let [log, picture, page] =
        ["hunt.jsonl", "hunt.svg", "report.html"].map(|name| args.out.join(name));
    [&log, &picture, &page].into_iter().try_for_each(|path| check_writable(path))?;

    let (hunt, events, turns) = fly(args, setup, &header, &log, live.as_ref())?;

    let svg = hunt_svg(&header, &events).map_err(CliError::failure)?;
    fs::write(&picture, svg).map_err(|error| CliError::writing(&picture, error))?;

    let flown = Log { header, events, torn: false };
    let antenna = Antennas::of(&scenario.extractor);
    let struck = Struck::default();
    let (overview, _) =
        Overview::of_log(&flown, registry, Some(&estimator), &struck, turns, antenna.known())
            .map_err(CliError::failure)?;
    let page_log = PageLog::new(&flown.header, None, &flown.events);
    args.exports.write_page(&page, &overview, Some(&page_log), tiles.as_ref())?;

    let report = HuntReport::new(args.seed, &estimator.name, args.planning.name(), &hunt);
    let remarks = (overview.searches.iter())
        .map(|search| Doubted { beacon: search.name.clone(), remarks: search.remarks.clone() })
        .collect();
    output.result(&Examined { report, remarks }, text)?;
    let log = log.display();
    let picture = picture.display();
    let page = page.display();
    output.note(&format!("log: {log}\npicture: {picture}\nreport: {page}"))?;
    args.exports.write(&overview, output)?;
    if let Some(live) = live {
        // Ctrl-C ends the program.
        live.stay(|| false);
    }
    Ok(())
}

/// Flies the hunt into a log, and keeps its events and turns for the picture and the page.
fn fly(
    args: &Args,
    setup: Setup<'_>,
    header: &LogHeader,
    log: &Path,
    live: Option<&LiveView>,
) -> Result<(Simulated, Vec<Event>, Vec<KeptTurn>), CliError> {
    // A scenario that cannot be flown has no event, and leaves the log of the hunt before.
    let mut writer = None;
    let mut events = Vec::new();
    let mut notices = Notices::default();
    let (tap, turns) = keep_turns();
    let pace = args.pace.start();
    let hunt = setup.simulate_tapped(args.seed, &tap, |event| {
        if let Some(live) = live {
            pace.wait_until(event.time());
            live.show(event, &turns.borrow());
        }
        notices.print(event);
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
    notices.finish();
    let hunt = hunt.map_err(|error| choice::simulation_error(error, &args.scenario))?;
    Ok((hunt, events, turns.take()))
}

/// A hunt with the doubts about its places.
#[derive(Debug, Serialize)]
struct Examined {
    #[serde(flatten)]
    report: HuntReport,
    /// Doubts about the place of each search.
    remarks: Vec<Doubted>,
}

/// Doubts about the place of a beacon.
#[derive(Debug, Serialize)]
struct Doubted {
    beacon: String,
    remarks: Vec<Remark>,
}

/// An event that could not be written down.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot be written: {source}", path.display())]
struct NotLogged {
    path: PathBuf,
    source: io::Error,
}

fn text(Examined { report, remarks }: &Examined) -> String {
    let doubts: String = (remarks.iter())
        .map(|of| fixes::doubts(&of.remarks, &format!(" of {}", of.beacon)))
        .collect();
    format!(
        "{}, seed {}, {:.0} simulated seconds\n{}\n{}{}{doubts}",
        report.estimator,
        report.seed,
        report.duration_s,
        fixes::fixes(report.beacons.iter().map(row)),
        fixes::LEGEND,
        transmitters(report)
    )
}

/// The transmitters on one frequency, where the estimator looks for several.
fn transmitters(report: &HuntReport) -> String {
    let several = report.beacons.iter().filter_map(|beacon| {
        let of = beacon.transmitters.as_ref()?;
        let table = fixes::transmitters(&beacon.name, &of.found);
        let there = of.truths.len();
        let gospa_m = of.gospa_m;
        Some(format!("\n{table}\nTrue number: {there}; GOSPA: {gospa_m:.2} m (c = 50 m, p = 2)."))
    });
    several.collect()
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
