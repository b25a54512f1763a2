use std::{path::PathBuf, thread};

use foxhunt::{
    core::Clock,
    fly::{FlightConfig, SystemPorts},
    hardware::link::{DroneLink, Impaired, Impairment, Leave, Stage, UnixTime},
    network::{DroneNode, DroneNodeConfig, FlownNode, uniform_draws},
    sim::World,
};

use super::over::{Failures, NodeClock, Shared, Stop};
use crate::{
    commands::{choice, fly, notices::Notices},
    error::CliError,
    output::{Context, warn},
};

/// Run a drone's part: fly and turn the antenna as the fusion node orders, and report receptions
///
/// With a flight's file the drone is a real one, flown by the pilot's rules of that file: it takes
/// off when the fusion node lets all drones take off, and returns or lands when the hunt is over or
/// no order has come for flight.orders_timeout_s. Ctrl-C has it leave by flight.on_abort; a second
/// Ctrl-C ends the node at once. Started again in the air, it goes on with --take-over.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The flight: a TOML file (docs/flying.md), the same on all computers
    #[arg(required_unless_present = "simulate", conflicts_with = "simulate")]
    flight: Option<PathBuf>,
    /// The number of the drone, counted from 0
    #[arg(long, value_name = "N")]
    drone: usize,
    /// Fly this drone of a simulated world: a built-in scenario or a TOML file
    #[arg(long, value_name = "SCENARIO")]
    simulate: Option<String>,
    /// Take over the drone if it is in the air already, in the mode that takes orders: after a
    /// restart, if nobody else flies it
    #[arg(long, conflicts_with = "simulate")]
    take_over: bool,
    /// The seed of the simulated world's random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Drop this share of the sent messages, from 0 to 1, as a rehearsal
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    drop: f64,
    #[command(flatten)]
    shared: Shared,
}

impl Args {
    /// Returns the link, with the losses of --drop.
    fn link(&self, clock: impl Clock + 'static) -> Result<Box<dyn DroneLink>, CliError> {
        let link = self.shared.drone(self.drone)?;
        let impairment = Impairment { loss: self.drop, ..Impairment::default() };
        let draws = uniform_draws(self.seed.wrapping_add(0x5eed));
        Ok(Box::new(Impaired::new(link, impairment, clock, draws).map_err(CliError::input)?))
    }
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    match (&args.simulate, &args.flight) {
        (Some(scenario), _) => simulate(args, scenario, context),
        (None, Some(file)) => {
            fly(args, &FlightConfig::read(file).map_err(CliError::input)?, context)
        }
        (None, None) => Err(CliError::input("give a flight's file or --simulate")),
    }
}

fn simulate(args: &Args, scenario: &str, context: Context<'_>) -> Result<(), CliError> {
    let name = scenario;
    let registry = context.registry;
    let scenario = choice::scenario(name)?;
    let world = World::new(&scenario.world, args.seed).map_err(CliError::input)?;
    let vehicle = world.vehicle(args.drone).map_err(CliError::input)?;
    let sources = scenario.sources(registry, &world).map_err(CliError::input)?;
    let source = sources.into_iter().nth(args.drone);
    let source = source.ok_or_else(|| CliError::input("the drone has no source"))?;
    let extractor = registry
        .hunt_extractor(&scenario.extractor, scenario.bearings)
        .map_err(|error| choice::simulation_error(error.into(), name))?;
    let link = args.link(world.clock())?;
    let stop = Stop::listen()?;
    let clock = args.shared.clock();
    let epoch = clock.unix()?;
    let config = DroneNodeConfig::default();
    let mut node = DroneNode::new(source, vehicle, extractor, link, epoch, config)
        .map_err(CliError::failure)?;
    let mut failures = Failures::default();
    let mut followed = 0;
    warn(&format!("drone {} of {} is on", args.drone, scenario.name));
    while stop.goes_on() {
        let due = clock.unix()?.since(epoch);
        while world.time() < due {
            world.advance(scenario.simulation.tick_s).map_err(CliError::failure)?;
            failures.report(node.step(world.time()))?;
        }
        let turn = &node.order().turn;
        if turn.number > followed {
            followed = turn.number;
            warn(&format!("{:7.0} s  listens", world.time()));
        }
    }
    Ok(())
}

/// Time for which a node reports that its drone is down before it ends, in seconds.
const FAREWELL_S: f64 = 3.0;

fn fly(args: &Args, config: &FlightConfig, context: Context<'_>) -> Result<(), CliError> {
    let count = config.drones.len();
    let drone = config.drones.get(args.drone).ok_or_else(|| {
        let drone = args.drone;
        CliError::input(format!("--drone {drone}: the flight has {count} drones, counted from 0"))
    })?;
    let extractor = context.registry.hunt_extractor(&config.extractor, config.bearings);
    let extractor = extractor.map_err(CliError::input)?;
    let stop = Stop::listen()?;
    let node_clock: NodeClock = args.shared.clock();
    let clock = move || node_clock.seconds();
    let epoch = node_clock.started()?;
    let origin_s = epoch.since(UnixTime::default());
    let link = args.link(clock)?;
    // In the air there is no time for it.
    if !args.take_over {
        let one = std::slice::from_ref(drone);
        fly::examine_devices(config, one, &clock, origin_s, context.output);
    }
    let mut ports = SystemPorts::new(clock);
    let goal = config.goal(context.registry).map_err(CliError::input)?;
    let ground = config.ground().map_err(CliError::input)?;
    let open = drone.open(config, ground.as_ref(), &mut ports, &clock, origin_s, goal.as_ref());
    let open = open.map_err(fly::open_error)?;
    let rules = config.flight;
    let node_config = DroneNodeConfig::default();
    let node = FlownNode::new(args.drone, open, extractor, link, epoch, rules, node_config);
    let mut node = node.map_err(CliError::input)?;
    if args.take_over {
        node.allow_take_over();
    }
    warn(&format!("{} of {} is on; Ctrl-C has it leave", drone.name, config.name));
    let mut failures = Failures::default();
    let mut interrupts = 0;
    let mut over_at = None;
    let mut reported = Stage::Over;
    let mut notices = Notices::default();
    loop {
        let time = clock();
        failures.report(node.step(time))?;
        while let Some(event) = node.poll_event() {
            notices.print(&event);
        }
        let stage = (node.stage(), node.reason().to_owned());
        // What keeps it from flying comes with the events.
        if stage.0 != reported {
            let why = if stage.1.is_empty() { String::new() } else { format!(": {}", stage.1) };
            warn(&format!("{time:7.0} s  {} {}{why}", drone.name, stage.0));
            reported = stage.0;
        }
        let wanted = stop.count();
        if wanted > interrupts {
            if interrupts > 0 {
                let text = "stopped: a drone in the air is left to its autopilot and its pilot";
                return Err(CliError::failure(text));
            }
            interrupts = wanted;
            node.abort(time, "its own computer broke off");
        }
        if node.stage() == Stage::Over && time - *over_at.get_or_insert(time) >= FAREWELL_S {
            break;
        }
        thread::sleep(fly::TICK);
    }
    notices.finish();
    match node.order().leave {
        Leave::AtEnd => Ok(()),
        _ => Err(CliError::failure(node.reason())),
    }
}
