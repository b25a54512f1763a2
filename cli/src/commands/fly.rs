use std::{
    cell::{Cell, RefCell},
    fs::{self, File},
    io::{self, BufRead, IsTerminal},
    path::{Path, PathBuf},
    rc::Rc,
    sync::{
        Arc,
        atomic::{AtomicU8, Ordering},
        mpsc::{self, Receiver},
    },
    thread,
    time::Duration,
};

use foxhunt::{
    core::{Clock, Sweep},
    fly::{FlightConfig, FlightReport, FlyError, Mission, Tap},
    hardware::{Finding, SystemClock},
    log::LogWriter,
    picture::hunt_svg,
    recording::{RecordingError, SweepWriter},
};

use super::{choice, fixes, flight_plan, notices::narrate};
use crate::{context::Context, error::CliError, output::warn};

/// Fly a hunt on real devices
///
/// Examines the devices that the file names, waits until every drone is ready, and asks before any
/// motor turns. Then all take off, hunt, and come back. Enter or Ctrl-C breaks off at any time: the
/// drones then follow flight.on_abort of the file. Everything is logged from the first second.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt fly meadow.toml --dry-run\n  \
                        foxhunt fly meadow.toml --out flights/meadow-3\n\n\
                        Look at every device first: foxhunt devices meadow.toml")]
pub(crate) struct Args {
    /// The flight: a TOML file (docs/flying.md)
    config: PathBuf,
    /// Check the file, print the plan, and touch no device
    #[arg(long)]
    dry_run: bool,
    /// Take off without asking
    #[arg(long)]
    yes: bool,
    /// The seed of estimators that draw random numbers
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// The folder for the log, the samples and the picture; nothing in it is overwritten
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
}

/// The time between two steps of the flight.
const TICK: Duration = Duration::from_millis(5);

pub(crate) fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry } = context;
    let config = FlightConfig::read(&args.config).map_err(CliError::input)?;
    let file = args.config.display().to_string();
    let place = format!("{file}: estimator");
    let estimator = choice::estimator(registry, &config.estimator, &place)?;
    let hunt = config.parts(registry, estimator, args.seed).build().map_err(CliError::input)?;
    if args.dry_run {
        return flight_plan::print(&config, hunt, output);
    }
    if !args.yes && !io::stdin().is_terminal() {
        return Err(CliError::input(
            "standard input is no terminal, so that nobody can confirm the take-off; --yes takes \
             off at once",
        ));
    }
    fs::create_dir_all(&args.out).map_err(|error| CliError::writing(&args.out, error))?;
    let files = Files::free_in(&args.out)?;
    let system = SystemClock::start();
    // Time 0 is the whole second before.
    let epoch_s = system.started_unix_s().floor();
    let fraction = system.started_unix_s() - epoch_s;
    let clock = move || system.now() + fraction;
    #[expect(clippy::cast_possible_truncation, reason = "a whole number of seconds")]
    let epoch = epoch_s as i64;
    let header = config.log_header(estimator, args.seed, Some(epoch));
    let mut log = LogWriter::new(files.create(&files.log)?, &header)
        .map_err(|error| CliError::writing(&files.log, error))?;
    let samples = Rc::new(RefCell::new(Samples {
        writer: SweepWriter::new(files.create(&files.samples)?).map_err(CliError::failure)?,
        config: config.clone(),
        failure: None,
    }));
    let pilot = Pilot::listen()?;
    let kept = Rc::clone(&samples);
    let keep = move |drone: usize, sweep: &Sweep<'_>| kept.borrow_mut().keep(drone, sweep);
    let tap: Tap = Rc::new(RefCell::new(keep));
    examine_devices(&config, &clock, epoch_s);
    let drones = config.open(&clock, epoch_s, Some(&tap)).map_err(open_error)?;
    let mut mission =
        Mission::new(config.flight, hunt, drones, clock.now()).map_err(CliError::input)?;
    mission.wait_for_go(!args.yes);
    warn(&format!("log: {}; Enter breaks off", files.log.display()));

    let mut events = Vec::new();
    let mut prompted = false;
    while !mission.is_over() {
        let time = clock.now();
        mission.step(time);
        if mission.is_ready() && !prompted {
            prompted = true;
            warn("all drones are ready: Enter takes off, Ctrl-C breaks off");
        }
        match pilot.poll() {
            PilotInput::None => {}
            PilotInput::Enter if mission.is_ready() => mission.go(),
            PilotInput::Enter | PilotInput::Interrupt => {
                mission.abort(time, "the pilot breaks off");
            }
            PilotInput::Quit => {
                let text = "the pilot quit: aircraft in the air are left to their autopilots and \
                            remote controls";
                return Err(CliError::failure(text));
            }
        }
        while let Some(event) = mission.poll_event() {
            narrate(&event);
            if let Err(error) = log.event(&event) {
                mission.abort(time, &format!("{}: {error}", files.log.display()));
            }
            events.push(event);
        }
        if let Some(error) = samples.borrow_mut().failure.take() {
            mission.abort(time, &format!("{}: {error}", files.samples.display()));
        }
        thread::sleep(TICK);
    }
    while let Some(event) = mission.poll_event() {
        narrate(&event);
        log.event(&event).map_err(|error| CliError::writing(&files.log, error))?;
        events.push(event);
    }
    let svg = hunt_svg(&header, &events).map_err(CliError::failure)?;
    fs::write(&files.picture, svg).map_err(|error| CliError::writing(&files.picture, error))?;
    let report = FlightReport::new(&config.name, &mission, clock.now());
    output.result(&report, text)?;
    let Files { log, samples, picture } = &files;
    let (log, samples, picture) = (log.display(), samples.display(), picture.display());
    output.note(&format!("log: {log}\nsamples: {samples}\npicture: {picture}"))?;
    match mission.failure() {
        Some(why) => Err(CliError::failure(why)),
        None => Ok(()),
    }
}

/// Examines the devices before anybody flies, and prints what is wrong. Whether that matters is the
/// pilot's decision: a beacon may be too far to be received from here.
fn examine_devices(config: &FlightConfig, clock: &(impl Clock + Clone + 'static), epoch_s: f64) {
    let mut pause = || thread::sleep(Duration::from_millis(1));
    for drone in &config.drones {
        let mut report = |device: &'static str, findings: Vec<Finding>| {
            for finding in findings.iter().filter(|finding| !finding.is_good()) {
                warn(&format!("{}, {device}: {finding}", drone.name));
            }
        };
        let (site, beacons) = (&config.site, &config.beacons);
        drone.examine(site, beacons, clock, epoch_s, &mut pause, &mut report);
    }
}

fn open_error(error: FlyError) -> CliError {
    match error {
        FlyError::Open { .. } => CliError::failure(error),
        _ => CliError::input(error),
    }
}

fn text(report: &FlightReport) -> String {
    let rows = report.beacons.iter().map(|beacon| fixes::Row {
        beacon: &beacon.name,
        estimate: beacon.estimate,
        ellipse_95: beacon.ellipse_95,
        error_m: None,
        nees: None,
        steps: beacon.steps,
        outcome: beacon.outcome.to_string(),
    });
    format!(
        "{}, {:.0} s\n{}\n{}",
        report.name,
        report.duration_s,
        fixes::fixes(rows),
        fixes::LEGEND
    )
}

/// The files that a flight writes.
struct Files {
    log: PathBuf,
    samples: PathBuf,
    picture: PathBuf,
}

impl Files {
    /// The first names in a folder that no flight has taken.
    fn free_in(folder: &Path) -> Result<Self, CliError> {
        for number in 1..10_000 {
            let name = |end: &str| folder.join(format!("fly-{number}{end}"));
            let files =
                Self { log: name(".jsonl"), samples: name("-samples.csv"), picture: name(".svg") };
            if [&files.log, &files.samples, &files.picture].iter().all(|path| !path.exists()) {
                return Ok(files);
            }
        }
        Err(CliError::failure(format!("{}: too many flights", folder.display())))
    }

    fn create(&self, path: &Path) -> Result<File, CliError> {
        File::create_new(path).map_err(|error| CliError::writing(path, error))
    }
}

/// The raw samples of all drones, in a file that `bearing`, `locate` and `calibrate` read.
struct Samples {
    writer: SweepWriter<File>,
    config: FlightConfig,
    failure: Option<RecordingError>,
}

impl Samples {
    fn keep(&mut self, drone: usize, sweep: &Sweep<'_>) {
        let drone = self.config.drones.get(drone);
        let beacon = self.config.beacons.get(usize::from(sweep.beacon.0));
        if let (Some(drone), Some(beacon)) = (drone, beacon)
            && let Err(error) = self.writer.write(&drone.name, &beacon.name, sweep)
        {
            self.failure.get_or_insert(error);
        }
    }
}

/// The person at the keyboard.
struct Pilot {
    lines: Receiver<()>,
    interrupts: Arc<AtomicU8>,
    handled: Cell<u8>,
}

/// What the pilot wants.
enum PilotInput {
    None,
    Enter,
    Interrupt,
    /// A second interrupt: the program shall end at once.
    Quit,
}

impl Pilot {
    /// Listens to the keyboard and to interrupts.
    fn listen() -> Result<Self, CliError> {
        let interrupts = Arc::new(AtomicU8::new(0));
        let counted = Arc::clone(&interrupts);
        ctrlc::set_handler(move || {
            let _ = counted.fetch_add(1, Ordering::Relaxed);
        })
        .map_err(CliError::failure)?;
        let (line, lines) = mpsc::channel();
        // It ends with the program: nothing else can end a read of the keyboard.
        thread::spawn(move || {
            for _ in io::stdin().lock().lines().map_while(Result::ok) {
                if line.send(()).is_err() {
                    break;
                }
            }
        });
        Ok(Self { lines, interrupts, handled: Cell::new(0) })
    }

    /// What the pilot did since the last call.
    fn poll(&self) -> PilotInput {
        let interrupts = self.interrupts.load(Ordering::Relaxed);
        let before = self.handled.replace(interrupts);
        if before != interrupts {
            // Two that come at once are one: the terminal and a script may both send it.
            return if before > 0 { PilotInput::Quit } else { PilotInput::Interrupt };
        }
        if self.lines.try_recv().is_ok() { PilotInput::Enter } else { PilotInput::None }
    }
}
