//! Emulated devices as programs: what a driver, ours or another's, meets instead of a real one.

mod device;
mod field;
mod onboard;
mod positioning;
mod rtl_tcp;

pub use field::{Emulated, Emulation};

use std::{
    fs,
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use foxhunt::{scenario::Scenario, sim::World};
use serde::Serialize;

use self::{
    device::{Field, Placed},
    onboard::{StepperArgs, VehicleArgs, XbeeArgs, place_stepper, place_vehicle, place_xbee},
    positioning::{
        GnssArgs, MotionCaptureArgs, ar_drone, caster, place_gnss, place_motion_capture,
    },
    rtl_tcp::write_samples,
};
use super::choice;
use crate::{
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
pub struct Args {
    #[command(subcommand)]
    device: Device,
}

/// Emulated device.
#[derive(Debug, clap::Subcommand)]
enum Device {
    Xbee(XbeeArgs),
    Stepper(StepperArgs),
    Vehicle(VehicleArgs),
    Gnss(GnssArgs),
    MotionCapture(MotionCaptureArgs),
    RtlTcp(rtl_tcp::Args),
    Field(field::Args),
}

/// Maximum lag of a field's time behind the wall clock, in seconds. On a busy computer the field
/// then runs slower, so that its clients miss no heartbeats.
const MOST_BEHIND_S: f64 = 0.1;

/// A device in the JSON result.
#[derive(Serialize)]
struct Announced<'a> {
    device: &'static str,
    endpoint: &'a str,
}

pub fn run(args: &Args, output: Output) -> Result<(), CliError> {
    let field = match &args.device {
        Device::Xbee(args) => &args.field,
        Device::Stepper(args) => &args.field,
        Device::Vehicle(args) => &args.field,
        Device::Gnss(args) => &args.field,
        Device::MotionCapture(args) => &args.field,
        Device::RtlTcp(args) => &args.field,
        Device::Field(args) => &args.field,
    };
    let scenario = choice::scenario(&field.scenario)?;
    let world = World::new(&scenario.world, field.seed).map_err(CliError::input)?;
    // The drone goes first where it is by now.
    let first = match &args.device {
        Device::Xbee(args) => args.pose.place(field, &world)?,
        Device::Stepper(args) => args.pose.place(field, &world)?,
        Device::RtlTcp(args) => args.pose.place(field, &world)?,
        Device::Gnss(args) => caster(args, &world)?,
        Device::MotionCapture(_) | Device::Vehicle(_) | Device::Field(_) => None,
    };
    let mut placed: Vec<Placed> = first.into_iter().collect();
    if let Device::MotionCapture(args) = &args.device {
        placed.extend(ar_drone(args, &world)?);
    }
    placed.push(match &args.device {
        Device::Xbee(args) => place_xbee(args, &scenario, &world),
        Device::Stepper(args) => place_stepper(args, &scenario, &world),
        Device::Vehicle(args) => place_vehicle(args, &scenario, &world),
        Device::Gnss(args) => place_gnss(args, &scenario, &world),
        Device::MotionCapture(args) => place_motion_capture(args, &world),
        Device::RtlTcp(args) => {
            if let Some(to) = args.to() {
                return write_samples(args, to, &world, output);
            }
            rtl_tcp::place(args, &world)
        }
        Device::Field(args) => field::place(args, &scenario, &world),
    }?);
    serve(field, &scenario, &world, placed, output)
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
    let mut due = world.time();
    let mut before = Instant::now();
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
