use std::{
    fs, io,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use foxhunt::{
    scenario::{DEFAULT_SCENARIO, Scenario},
    sim::{Emulator, World},
};
use serde::Serialize;

use super::{field, gnss, rtl_tcp, sample_file, stepper, vehicle, xbee};
use crate::{
    commands::choice,
    error::CliError,
    output::{Output, warn},
};

/// Emulate the devices of a simulated field
///
/// Puts a device of a scenario's drone behind a serial port or a UDP port of this machine, with the
/// protocol of the real one. Any program for the real device works with this one. Ends with Ctrl-C.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt emulate xbee --link /tmp/xbee\n  \
                        foxhunt emulate vehicle --drone 2 --speed 5\n  \
                        foxhunt emulate rtl-tcp --scenario vhf-tag\n  \
                        foxhunt emulate xbee --pose udpin:127.0.0.1:14551")]
pub(crate) struct Args {
    #[command(subcommand)]
    device: Device,
}

/// What is emulated.
#[derive(Debug, clap::Subcommand)]
enum Device {
    Xbee(xbee::Args),
    Stepper(stepper::Args),
    Vehicle(vehicle::Args),
    Gnss(gnss::Args),
    RtlTcp(rtl_tcp::Args),
    Field(field::Args),
}

/// The arguments of all emulated devices.
#[derive(Debug, clap::Args)]
pub(super) struct Field {
    /// The field that it works in: a built-in scenario or a TOML file
    #[arg(long, value_name = "SCENARIO", default_value = DEFAULT_SCENARIO)]
    scenario: String,
    /// Which of the scenario's drones carries it, counted from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) drone: usize,
    /// The seed of everything that is drawn at random
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(super) seed: u64,
    /// How much faster than the clock on the wall the device's time runs, for programs that know it
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = positive)]
    pub(super) speed: f64,
    /// End after so many seconds of the field's time
    #[arg(long = "for", value_name = "S", value_parser = positive)]
    pub(super) duration_s: Option<f64>,
    /// Where to put a symbolic link to the serial port; what is there is replaced if it is a link
    #[arg(long, value_name = "PATH")]
    pub(super) link: Option<PathBuf>,
}

/// The farthest that a field's time falls behind, in seconds of the wall: on a busy computer it
/// runs slower, rather than past the heartbeats of whoever flies in it.
const MOST_BEHIND_S: f64 = 0.1;

/// A device that is ready to be served.
pub(super) struct Placed {
    /// What it is, such as `xbee`.
    pub(super) device: &'static str,
    /// How it is reached, as `foxhunt fly` takes it.
    pub(super) endpoint: String,
    pub(super) emulator: Box<dyn Emulator>,
}

/// A device in the result, as JSON has it.
#[derive(Serialize)]
struct Announced<'a> {
    device: &'static str,
    endpoint: &'a str,
}

pub(crate) fn run(args: &Args, output: Output) -> Result<(), CliError> {
    let field = match &args.device {
        Device::Xbee(args) => &args.field,
        Device::Stepper(args) => &args.field,
        Device::Vehicle(args) => &args.field,
        Device::Gnss(args) => &args.field,
        Device::RtlTcp(args) => &args.field,
        Device::Field(args) => &args.field,
    };
    let scenario = choice::scenario(&field.scenario)?;
    let world = World::new(&scenario.world, field.seed).map_err(CliError::input)?;
    // The drone goes first where it is by now.
    let pose = match &args.device {
        Device::Xbee(args) => args.pose.place(field, &world)?,
        Device::Stepper(args) => args.pose.place(field, &world)?,
        Device::RtlTcp(args) => args.pose.place(field, &world)?,
        Device::Vehicle(_) | Device::Gnss(_) | Device::Field(_) => None,
    };
    let placed = match &args.device {
        Device::Xbee(args) => xbee::place(args, &scenario, &world),
        Device::Stepper(args) => stepper::place(args, &scenario, &world),
        Device::Vehicle(args) => vehicle::place(args, &scenario, &world),
        Device::Gnss(args) => gnss::place(args, &scenario, &world),
        Device::RtlTcp(args) => {
            if let Some(to) = args.to() {
                return sample_file::write(args, to, &world, output);
            }
            rtl_tcp::place(args, &world)
        }
        Device::Field(args) => field::place(args, &scenario, &world),
    }?;
    serve(field, &scenario, &world, pose.into_iter().chain([placed]).collect(), output)
}

/// Serves devices until the time is up or Ctrl-C comes.
fn serve(
    field: &Field,
    scenario: &Scenario,
    world: &World,
    mut placed: Vec<Placed>,
    output: Output,
) -> Result<(), CliError> {
    let announced: Vec<_> =
        placed.iter().map(|p| Announced { device: p.device, endpoint: &p.endpoint }).collect();
    output.result(&announced, |announced| {
        announced.iter().map(|a| format!("{}: {}\n", a.device, a.endpoint)).collect()
    })?;
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    ctrlc::set_handler(move || stopped.store(true, Ordering::Relaxed))
        .map_err(CliError::failure)?;
    let target = field.link.as_ref().and_then(|link| fs::read_link(link).ok());
    let (mut due, mut before) = (world.time(), Instant::now());
    while !stop.load(Ordering::Relaxed) {
        let now = Instant::now();
        due += now.duration_since(before).as_secs_f64() * field.speed;
        due = due.min(world.time() + MOST_BEHIND_S * field.speed);
        before = now;
        if field.duration_s.is_some_and(|duration| world.time() >= duration) {
            break;
        }
        while world.time() < due {
            world.advance(scenario.simulation.tick_s).map_err(CliError::failure)?;
            for Placed { device, emulator, .. } in &mut placed {
                // A port that fails is tried again; its user gets an error of his own.
                if let Err(error) = emulator.serve() {
                    warn(&format!("{device}: {error}"));
                }
            }
        }
        thread::sleep(Duration::from_millis(1));
    }
    // It may have been replaced by another program's meanwhile, or be none of ours.
    let ours = |link: &PathBuf| fs::read_link(link).ok().is_some_and(|to| Some(to) == target);
    if let Some(link) = field.link.as_ref().filter(|link| ours(link)) {
        let _ = fs::remove_file(link);
    }
    Ok(())
}

/// Links to the pseudo-terminal of a device where one is given; what names it then.
pub(super) fn linked(port: &Path, link: Option<&Path>) -> Result<String, CliError> {
    let Some(link) = link else { return Ok(port.display().to_string()) };
    let replaced = match fs::symlink_metadata(link) {
        Ok(there) if there.is_symlink() => fs::remove_file(link),
        Ok(_) => Err(io::Error::new(io::ErrorKind::AlreadyExists, "something else is there")),
        Err(_) => Ok(()),
    };
    replaced
        .and_then(|()| std::os::unix::fs::symlink(port, link))
        .map_err(|error| CliError::writing(link, error))?;
    Ok(link.display().to_string())
}

pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && f64::is_finite(value) => Ok(value),
        _ => Err("not a positive number".into()),
    }
}
