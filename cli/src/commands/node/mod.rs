//! The nodes of a hunt on several computers, as programs.

#[cfg(any(feature = "ros1", feature = "ros2"))]
mod drone;
#[cfg(any(feature = "ros1", feature = "ros2"))]
mod fusion;
#[cfg(any(feature = "ros1", feature = "ros2"))]
mod log;
#[cfg(any(feature = "ros1", feature = "ros2"))]
mod over;

#[cfg(not(any(feature = "ros1", feature = "ros2")))]
use crate::commands::unavailable;
use crate::{context::Context, error::CliError};

/// Run one computer's part of a hunt over ROS 1 or ROS 2
///
/// Every drone's computer runs a drone node, and one computer the fusion node. Messages may be
/// lost, late or doubled, and every node may be stopped and started again.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: three simulated drones and the fusion node, each in a terminal\n  \
                        foxhunt node drone --simulate pritzl-6.1 --drone 0 --over ros2\n  \
                        foxhunt node fusion pritzl-6.1 --over ros2 --log out/net.jsonl --resume"
)]
pub(crate) struct Args {
    #[cfg(any(feature = "ros1", feature = "ros2"))]
    #[command(subcommand)]
    node: Node,
    #[cfg(not(any(feature = "ros1", feature = "ros2")))]
    #[command(flatten)]
    unavailable: unavailable::AnyArguments,
}

/// Which part.
#[cfg(any(feature = "ros1", feature = "ros2"))]
#[derive(Debug, clap::Subcommand)]
enum Node {
    Drone(drone::Args),
    Fusion(fusion::Args),
}

#[cfg(any(feature = "ros1", feature = "ros2"))]
pub(crate) fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    match &args.node {
        Node::Drone(args) => drone::run(args, context),
        Node::Fusion(args) => fusion::run(args, context),
    }
}

#[cfg(not(any(feature = "ros1", feature = "ros2")))]
pub(crate) fn run(args: &Args, _: Context<'_>) -> Result<(), CliError> {
    args.unavailable.refuse("node", "ros1,ros2")
}
