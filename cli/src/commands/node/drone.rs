use foxhunt::{
    hardware::link::{DroneLink, Impaired, Impairment},
    network::{DroneNode, DroneNodeConfig, uniform_draws},
    sim::World,
};

use super::over::{Failures, Shared, Stop};
use crate::{commands::choice, context::Context, error::CliError, output::warn};

/// Run a drone's part: fly and turn the antenna as the fusion node orders, and report receptions
///
/// Ends with Ctrl-C. Started again, it takes up the last order.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Which drone it is, counted from 0
    #[arg(long, value_name = "N")]
    drone: usize,
    /// Fly this drone of a simulated world: a built-in scenario or a TOML file
    #[arg(long, value_name = "SCENARIO")]
    simulate: String,
    /// The seed of everything that the simulated world draws at random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Lose so many of the messages that it sends, from 0 to 1, as a rehearsal
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    drop: f64,
    #[command(flatten)]
    shared: Shared,
}

pub(super) fn run(args: &Args, Context { registry, .. }: Context<'_>) -> Result<(), CliError> {
    let scenario = choice::scenario(&args.simulate)?;
    let world = World::new(&scenario.world, args.seed).map_err(CliError::input)?;
    let vehicle = world.vehicle(args.drone).map_err(CliError::input)?;
    let sources = scenario.sources(registry, &world).map_err(CliError::input)?;
    let source = sources.into_iter().nth(args.drone);
    let source = source.ok_or_else(|| CliError::input("the drone has no source"))?;
    let extractor = registry
        .hunt_extractor(&scenario.extractor, scenario.bearings)
        .map_err(|error| choice::simulation_error(error.into(), &args.simulate))?;
    let impairment = Impairment { loss: args.drop, ..Impairment::default() };
    let link: Box<dyn DroneLink> = Box::new(
        Impaired::new(
            args.shared.drone(args.drone)?,
            impairment,
            world.clock(),
            uniform_draws(args.seed.wrapping_add(0x5eed)),
        )
        .map_err(CliError::input)?,
    );
    let (stop, clock) = (Stop::listen()?, args.shared.clock());
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
