use clap::{Parser, Subcommand};

use crate::commands::{
    antenna, bearing, calibrate, campaign, estimators, extractors, hunt, locate, planners, replay,
    scenarios,
};
#[cfg(feature = "hardware")]
use crate::commands::{devices, emulate, fly, node};

/// Finds radio transmitters with drones.
///
/// A directional antenna turns under each drone; the received power over one turn gives a level
/// and a bearing; an estimator fuses them; the formation goes to where the next turn tells most.
/// Simulates whole hunts, compares estimators over thousands of them, replays logs, and works on
/// recorded flights.
#[derive(Debug, Parser)]
#[command(
    name = "foxhunt",
    version,
    propagate_version = true,
    after_help = "Exit code: 0 success, 2 wrong use or input, 1 a failure.\n\n\
                  Example: fly the default hunt and look at out/hunt.svg\n  foxhunt hunt"
)]
pub(crate) struct Cli {
    /// Print the result as one JSON value on standard output, all else on standard error
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// The subcommands, each with its file.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Hunt(hunt::Args),
    Campaign(campaign::Args),
    Scenarios(scenarios::Args),
    Estimators(estimators::Args),
    Extractors(extractors::Args),
    Planners(planners::Args),
    Replay(replay::Args),
    Calibrate(calibrate::Args),
    Locate(locate::Args),
    Bearing(bearing::Args),
    Antenna(antenna::Args),
    #[cfg(feature = "hardware")]
    Fly(fly::Args),
    #[cfg(feature = "hardware")]
    Devices(devices::Args),
    #[cfg(feature = "hardware")]
    Emulate(emulate::Args),
    #[cfg(feature = "hardware")]
    Node(node::Args),
}
