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
    core::{BeaconId, Clock, PatternSource, Sweep},
    export::CotPlatform,
    fly::{
        DroneConfig, Examined, FlightConfig, FlightReport, FlyError, Mission, Ports, SystemPorts,
        Tap,
    },
    hardware::{Aircraft, Finding, SystemClock},
    hunt::Event,
    log::{Log, LogWriter},
    nalgebra::Vector2,
    overview::Overview,
    page::PageLog,
    picture::hunt_svg,
    recording::{RecordingError, SweepWriter},
    sim::World,
    struck::Struck,
};

use super::{
    advice::Adviser,
    choice,
    emulate::{Emulated, Emulation},
    fixes,
    flight_plan::{self, checklist, write_missions},
    live::{LiveArgs, LiveView, PaceArgs, Shown},
    notices::Notices,
    tone::{Tone, ToneArgs},
    views::{Antennas, Exports, keep_turns, write_page},
};
use crate::{
    error::CliError,
    output::{Context, Output, check_writable, event, warn},
};

/// Fly a hunt on real devices
///
/// Examines the devices that the file names, waits until every drone is ready, and asks before any
/// motor turns. Then all take off, hunt, and come back. Enter or Ctrl-C breaks off at any time: the
/// drones then follow flight.on_abort of the file. Everything is logged from the first second.
///
/// With --emulate the devices of a simulated field are flown, in this program and in its time: the
/// same field, seed and faults fly the same flight, however busy the computer is. It ends with the
/// errors against the truth.
///
/// A vehicle that is carried or fixed needs no pilot: the next place is printed, beside the level,
/// its peak, and whether the way leads nearer. --tone makes the level audible.
///
/// With --advise the pilots fly with their own controls: foxhunt listens to the telemetry, turns
/// the antennas, and prints where to fly next.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt fly meadow.toml --dry-run\n  \
                        foxhunt fly meadow.toml --out flights/meadow-3\n  \
                        foxhunt fly --emulate pritzl-6.1\n  \
                        foxhunt fly meadow.toml --advise\n  \
                        foxhunt fly meadow.toml --live\n  \
                        foxhunt fly walker.toml --tone - | aplay\n  \
                        foxhunt fly meadow.toml --mission-to meadow.plan --hold-s 40\n\n\
                        Look at every device first: foxhunt devices meadow.toml")]
pub struct Args {
    /// The flight: a TOML file (docs/flying.md)
    #[arg(required_unless_present = "emulate")]
    config: Option<PathBuf>,
    /// Fly the emulated devices of this field, a built-in scenario or a TOML file, without asking
    #[arg(long, value_name = "SCENARIO", conflicts_with = "config")]
    emulate: Option<String>,
    /// A TOML file with the faults of the emulated field and their times (docs/flying.md)
    #[arg(long, value_name = "FILE", requires = "emulate")]
    faults: Option<PathBuf>,
    /// Check the file, print the plan, and touch no device
    #[arg(long, conflicts_with_all = ["cot", "mqtt"])]
    dry_run: bool,
    /// Write the flight of each drone as a mission for a ground station, and touch no device: .plan
    /// for QGroundControl, .waypoints for Mission Planner; needs a planner with places known
    /// beforehand
    #[arg(long, value_name = "FILE", conflicts_with_all = ["emulate", "dry_run", "cot", "mqtt"])]
    mission_to: Option<PathBuf>,
    /// The stay of a drone of the mission at each place, in seconds: the time of a turn of the
    /// antenna
    #[arg(long, value_name = "S", requires = "mission_to", default_value_t = 30.0)]
    hold_s: f64,
    /// Take off without asking
    #[arg(long)]
    yes: bool,
    /// Only advise: the pilots fly, nothing is sent to any vehicle, and the next places are printed
    #[arg(long, conflicts_with_all = ["emulate", "take_over"])]
    advise: bool,
    /// Take over drones already in the air, in the mode that takes orders; make sure that nobody
    /// else flies them
    #[arg(long)]
    take_over: bool,
    /// The seed of estimators that draw random numbers, and of an emulated field
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// The folder for the log, the samples, the picture and the page that shows the flight in any
    /// browser; nothing in it is overwritten
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    #[command(flatten)]
    live: LiveArgs,
    #[command(flatten)]
    pace: PaceArgs,
    #[command(flatten)]
    tone: ToneArgs,
    #[command(flatten)]
    exports: Exports,
}

/// The time between two steps of the flight.
pub const TICK: Duration = Duration::from_millis(5);

/// A flight with its clock and its devices.
struct Field {
    config: FlightConfig,
    /// Name of the file or the scenario.
    name: String,
    clock: Rc<dyn Fn() -> f64>,
    /// UNIX time at the clock's zero, in seconds; absent for an emulated field.
    epoch_s: Option<f64>,
    ports: Box<dyn Ports>,
    emulated: Option<Emulated>,
}

impl Field {
    /// The devices of a flight's file.
    fn real(path: &Path) -> Result<Self, CliError> {
        let config = FlightConfig::read(path).map_err(CliError::input)?;
        let system = SystemClock::start();
        // Time 0 is the whole second before.
        let epoch_s = system.started_unix_s().floor();
        let fraction = system.started_unix_s() - epoch_s;
        let clock: Rc<dyn Fn() -> f64> = Rc::new(move || system.now() + fraction);
        Ok(Self {
            config,
            name: path.display().to_string(),
            ports: Box::new(SystemPorts::new(calling(&clock))),
            clock,
            epoch_s: Some(epoch_s),
            emulated: None,
        })
    }

    /// The emulated devices of a scenario's field.
    fn emulated(scenario: &str, faults: Option<&Path>, seed: u64) -> Result<Self, CliError> {
        let Emulation { emulated, ports, config } = Emulated::place(scenario, faults, seed)?;
        let time = emulated.world.clock();
        Ok(Self {
            config,
            name: scenario.to_owned(),
            clock: Rc::new(move || time.now()),
            epoch_s: None,
            ports: Box::new(ports),
            emulated: Some(emulated),
        })
    }

    /// Drones of an emulated field that its scenario has lost for good.
    fn lost(&self, time: f64) -> impl Iterator<Item = usize> + use<> {
        let lost = self.emulated.as_ref().map(|emulated| emulated.lost(time));
        lost.into_iter().flatten()
    }

    /// Lets time pass until the next step.
    fn pass(&mut self) -> Result<(), CliError> {
        match &mut self.emulated {
            Some(emulated) => emulated.pass(),
            None => {
                thread::sleep(TICK);
                Ok(())
            }
        }
    }
}

/// A clock that devices may keep.
fn calling(clock: &Rc<dyn Fn() -> f64>) -> impl Clock + Clone + use<> {
    let clock = Rc::clone(clock);
    move || clock()
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    args.exports.check(args.live.is_on_map())?;
    let mut field = match (&args.config, &args.emulate) {
        (_, Some(scenario)) => Field::emulated(scenario, args.faults.as_deref(), args.seed)?,
        (Some(file), None) => Field::real(file)?,
        (None, None) => return Err(CliError::input("give a flight's file or --emulate")),
    };
    let mut config = field.config.clone();
    if args.advise {
        config = config.advised().map_err(CliError::input)?;
    }
    let place = format!("{}: estimator", field.name);
    let estimator = choice::estimator(registry, &config.estimator, &place)?;
    let planned = config.parts(registry, estimator, args.seed).build().map_err(CliError::input)?;
    if args.dry_run {
        return flight_plan::print(&config, planned, output);
    }
    if let Some(file) = &args.mission_to {
        return write_missions(&config, registry, file, args.hold_s, output);
    }
    let tiles = args.live.map()?;
    let live = args.live.plan_of(config.cot.as_ref(), &field.name)?;
    if live.is_none() && args.pace.is_given() {
        return Err(CliError::input("--pace: only with --live, --cot or --mqtt"));
    }
    if field.emulated.is_none() && args.pace.is_given() {
        return Err(CliError::input("--pace: real devices fly in their own time"));
    }
    if args.tone.takes_stdout() && output.streams() {
        return Err(CliError::input("--tone -: standard output is taken by --json"));
    }
    let is_carried = |drone: &DroneConfig| drone.vehicle.is_carried();
    if args.tone.is_given() && !config.drones.iter().any(is_carried) {
        return Err(CliError::input("--tone: no vehicle is carried"));
    }
    let flies = !config.is_on_the_ground();
    let confirms = flies && !args.yes && !args.advise && field.emulated.is_none();
    if confirms && !io::stdin().is_terminal() {
        return Err(CliError::input(
            "standard input is not a terminal, so the take-off cannot be confirmed; use --yes to \
             take off without asking",
        ));
    }
    fs::create_dir_all(&args.out).map_err(|error| CliError::writing(&args.out, error))?;
    let files = Files::free_in(&args.out)?;
    [&files.picture, &files.page].into_iter().try_for_each(|path| check_writable(path))?;
    let clock = calling(&field.clock);
    let epoch_s = field.epoch_s.unwrap_or(0.0);
    #[expect(clippy::cast_possible_truncation, reason = "a whole number of seconds")]
    let epoch = field.epoch_s.map(|epoch_s| epoch_s as i64);
    if field.emulated.is_none() {
        let examined = examine_devices(&config, &config.drones, &clock, epoch_s, output);
        config.stay_inside(&examined).map_err(CliError::input)?;
    }
    let hunt = config.parts(registry, estimator, args.seed).build().map_err(CliError::input)?;
    let mut header = config.log_header(estimator, args.seed, epoch);
    args.exports.check_known(header.origin.is_some(), epoch.is_some())?;
    if let Some(emulated) = &field.emulated {
        for (beacon, index) in header.beacons.iter_mut().zip(0..) {
            beacon.truth = place_at(&emulated.world, BeaconId(index), 0.0);
        }
    }
    let mut log = LogWriter::new(files.create(&files.log)?, &header)
        .map_err(|error| CliError::writing(&files.log, error))?;
    let samples = Rc::new(RefCell::new(Samples {
        writer: SweepWriter::new(files.create(&files.samples)?).map_err(CliError::failure)?,
        config: config.clone(),
        failure: None,
    }));
    let pilot = Pilot::listen()?;
    let platforms = platforms(&config);
    let shown = Shown {
        header: &header,
        registry,
        estimator,
        extractor: &config.extractor,
        platforms: &platforms,
        orders: true,
        nowhere: "the flight is in local metres",
        is_simulated: field.emulated.is_some(),
    };
    let live = live.map(|plan| LiveView::start(plan, &shown)).transpose()?;
    let adviser = Rc::new(RefCell::new(Adviser::new(&config, args.advise)));
    let advised = Rc::clone(&adviser);
    let mut tone = args.tone.open(field.emulated.is_some())?;
    let kept = Rc::clone(&samples);
    let (keep_turn, turns) = keep_turns();
    let keep = move |drone: usize, sweep: &Sweep<'_>| {
        kept.borrow_mut().keep(drone, sweep);
        advised.borrow_mut().received(drone, sweep);
        (keep_turn.borrow_mut())(drone, sweep);
    };
    let tap: Tap = Rc::new(RefCell::new(keep));
    let goal = config.goal(registry).map_err(CliError::input)?;
    let drones = config.open(field.ports.as_mut(), &clock, epoch_s, goal.as_ref(), Some(&tap));
    let drones = drones.map_err(open_error)?;
    let mut mission =
        Mission::new(config.flight, hunt, drones, clock.now()).map_err(CliError::input)?;
    mission.wait_for_go(confirms);
    if args.take_over {
        mission.allow_take_over();
    }
    let log_path = files.log.display();
    warn(&format!("log: {log_path}; Enter breaks off; {UP} clears what came down by itself"));

    let mut events = Vec::new();
    let mut notices = Notices::default();
    let mut prompted = false;
    // Emulated time would be over before anybody has looked.
    let pace = live.as_ref().filter(|_| field.emulated.is_some()).map(|_| args.pace.start());
    while !mission.is_over() {
        let time = clock.now();
        if let Some(pace) = &pace {
            pace.wait_until(time);
        }
        mission.step(time);
        if let Some(live) = &live {
            live.place(time, || mission.hunt().stations());
        }
        if mission.is_ready() && !prompted {
            prompted = true;
            warn("all drones are ready: Enter takes off, Ctrl-C breaks off");
        }
        pilot.steer(&mut mission, time)?;
        for drone in field.lost(time) {
            mission.write_off(drone);
        }
        if live.as_ref().is_some_and(LiveView::is_broken_off) {
            mission.abort(time, "broken off in the live view");
        }
        while let Some(event) = mission.poll_event() {
            notices.print(&event);
            notices.print_receivers(&event, mission.hunt(), |number| {
                config.drones.get(number).map(|drone| drone.name.clone())
            });
            stream(output, &event);
            if let Some(live) = &live {
                live.show(&event, &turns.borrow());
            }
            adviser.borrow().advise(&event, &config, mission.hunt());
            if let Err(error) = log.event(&event) {
                mission.abort(time, &format!("{}: {error}", files.log.display()));
            }
            events.push(event);
        }
        if let Some(error) = samples.borrow_mut().failure.take() {
            mission.abort(time, &format!("{}: {error}", files.samples.display()));
        }
        let levels = adviser.borrow_mut().report(time, mission.hunt());
        if let Some(tone) = &mut tone {
            for (time, level_dbm) in levels {
                tone.received(time, level_dbm);
            }
        }
        // Whatever becomes of the sound, the flight goes on.
        if let Some(Err(error)) = tone.as_mut().map(|tone| tone.pass(time)) {
            warn(&format!("{error}; there is no tone any more"));
            tone = None;
        }
        field.pass()?;
    }
    if let Some(Err(error)) = tone.map(Tone::finish) {
        warn(&error.to_string());
    }
    while let Some(event) = mission.poll_event() {
        notices.print(&event);
        stream(output, &event);
        if let Some(live) = &live {
            live.show(&event, &turns.borrow());
        }
        log.event(&event).map_err(|error| CliError::writing(&files.log, error))?;
        events.push(event);
    }
    notices.finish();
    let svg = hunt_svg(&header, &events).map_err(CliError::failure)?;
    fs::write(&files.picture, svg).map_err(|error| CliError::writing(&files.picture, error))?;
    let flown = Log { header, events, torn: false };
    let antenna = Antennas::of(&config.extractor);
    let struck = Struck::default();
    let turns = turns.take();
    let (overview, _) =
        Overview::of_log(&flown, registry, Some(estimator), &struck, turns, antenna.known())
            .map_err(CliError::failure)?;
    let page_log = PageLog::new(&flown.header, None, &flown.events);
    write_page(&files.page, &overview, Some(&page_log), tiles.as_ref())?;
    let events = flown.events;
    let truth = |beacon: BeaconId| {
        let received = last_received(&events, beacon)?;
        place_at(&field.emulated.as_ref()?.world, beacon, received)
    };
    let report = FlightReport::new(&config.name, &mission, clock.now(), truth);
    output.result(&report, text)?;
    let Files { log, samples, picture, page } = &files;
    let log = log.display();
    let samples = samples.display();
    let picture = picture.display();
    let page = page.display();
    output.note(&format!("log: {log}\nsamples: {samples}\npicture: {picture}\nreport: {page}"))?;
    args.exports.write(&overview, output)?;
    if let Some(live) = live {
        live.stay(|| matches!(pilot.poll(), PilotInput::Interrupt | PilotInput::Quit));
    }
    match mission.failure() {
        Some(why) => Err(CliError::failure(why)),
        None => Ok(()),
    }
}

/// Returns the receivers of a flight as teams see them.
pub fn platforms(config: &FlightConfig) -> Vec<CotPlatform> {
    let platforms = config.drones.iter().map(|drone| CotPlatform {
        name: drone.name.clone(),
        on_the_ground: drone.vehicle.is_on_the_ground(),
    });
    platforms.collect()
}

/// Prints an event as a line of JSON, where events are wanted.
fn stream(output: Output, happened: &Event) {
    if output.streams() {
        // Whatever becomes of standard output, the flight goes on and the log has the event.
        let _ = event("event", happened);
    }
}

/// Place of a beacon of a simulated world at a time, East and North in metres.
fn place_at(world: &World, beacon: BeaconId, time: f64) -> Option<Vector2<f64>> {
    Some(world.truth_at(beacon, time)?.xy())
}

/// Time of a beacon's last reception, which its fix is about.
fn last_received(events: &[Event], beacon: BeaconId) -> Option<f64> {
    events.iter().rev().find_map(|event| match event {
        Event::Received { reception, .. } if reception.beacon == beacon => Some(reception.time),
        _ => None,
    })
}

/// Examines the devices of drones before the flight, prints the checklist, and returns the
/// findings. The pilot decides if a fault matters: a beacon may be too far away to be received.
pub fn examine_devices(
    config: &FlightConfig,
    drones: &[DroneConfig],
    clock: &(impl Clock + Clone + 'static),
    epoch_s: f64,
    output: Output,
) -> Vec<Examined> {
    let mut pause = || thread::sleep(Duration::from_millis(1));
    let mut examined = Vec::new();
    for drone in drones {
        let mut report = |device: &'static str, findings: Vec<Finding>| {
            examined.push(Examined { drone: drone.name.clone(), device, findings });
        };
        let site = &config.site;
        let beacons = &config.beacons;
        drone.examine(site, beacons, clock, epoch_s, &mut pause, &mut report);
    }
    let checks = config.checklist(drones, Some(&examined));
    warn(&checklist(&checks));
    if output.streams() {
        // Whatever becomes of standard output, the flight goes on.
        let _ = event("checklist", &checks);
    }
    examined
}

pub fn open_error(error: FlyError) -> CliError {
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
        error_m: beacon.truth.map(|truth| truth.error_m),
        nees: beacon.truth.and_then(|truth| truth.nees),
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
    page: PathBuf,
}

impl Files {
    /// The first names in a folder that no flight has taken.
    fn free_in(folder: &Path) -> Result<Self, CliError> {
        for number in 1..10_000 {
            let name = |end: &str| folder.join(format!("fly-{number}{end}"));
            let files = Self {
                log: name(".jsonl"),
                samples: name("-samples.csv"),
                picture: name(".svg"),
                page: name("-report.html"),
            };
            let Self { log, samples, picture, page } = &files;
            if [log, samples, picture, page].iter().all(|path| !path.exists()) {
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
pub struct Pilot {
    lines: Receiver<String>,
    interrupts: Arc<AtomicU8>,
    handled: Cell<u8>,
}

/// The word that clears drones which came down without an order to take off again.
const UP: &str = "up";

/// Input of the pilot.
pub enum PilotInput {
    None,
    Enter,
    /// Clears drones that came down without an order to take off again.
    Up,
    Interrupt,
    /// A second interrupt: the program shall end at once.
    Quit,
}

impl Pilot {
    /// Listens to the keyboard and to interrupts.
    pub fn listen() -> Result<Self, CliError> {
        let interrupts = Arc::new(AtomicU8::new(0));
        let counted = Arc::clone(&interrupts);
        ctrlc::set_handler(move || {
            let _ = counted.fetch_add(1, Ordering::Relaxed);
        })
        .map_err(CliError::failure)?;
        let (line, lines) = mpsc::channel();
        // It ends with the program: nothing else can end a read of the keyboard.
        thread::spawn(move || {
            for typed in io::stdin().lock().lines().map_while(Result::ok) {
                if line.send(typed).is_err() {
                    break;
                }
            }
        });
        Ok(Self { lines, interrupts, handled: Cell::new(0) })
    }

    /// Carries out the pilot's input.
    fn steer<A: Aircraft, S: PatternSource>(
        &self,
        mission: &mut Mission<A, S>,
        time: f64,
    ) -> Result<(), CliError> {
        match self.poll() {
            PilotInput::None => {}
            PilotInput::Enter if mission.is_ready() => mission.go(),
            PilotInput::Up => mission.clear_to_take_off(time),
            PilotInput::Enter | PilotInput::Interrupt => {
                mission.abort(time, "the pilot breaks off");
            }
            PilotInput::Quit => {
                let text = "the pilot quit: aircraft in the air are left to their autopilots and \
                            remote controls";
                return Err(CliError::failure(text));
            }
        }
        Ok(())
    }

    /// Returns the pilot's input since the last call.
    pub fn poll(&self) -> PilotInput {
        let interrupts = self.interrupts.load(Ordering::Relaxed);
        let before = self.handled.replace(interrupts);
        if before != interrupts {
            // Two that come at once are one: the terminal and a script may both send it.
            return if before > 0 { PilotInput::Quit } else { PilotInput::Interrupt };
        }
        match self.lines.try_recv() {
            Ok(typed) if typed.trim().eq_ignore_ascii_case(UP) => PilotInput::Up,
            Ok(_) => PilotInput::Enter,
            Err(_) => PilotInput::None,
        }
    }
}
