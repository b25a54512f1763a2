//! The nodes of a hunt on several computers, as programs.

mod drone;
mod field;
mod fusion;
mod over;

use crate::{error::CliError, output::Context};

/// Run one computer's part of a hunt, over MQTT, ROS 1 or ROS 2
///
/// Every drone's computer runs a drone node, and one computer the fusion node. Messages may be
/// lost, late or doubled, and every node may be stopped and started again. They are signed with the
/// key of the team.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples: the key of the team, then three simulated drones and the fusion node, \
                  each in a terminal\n  \
                        foxhunt node key team.key\n  \
                        foxhunt node drone --simulate pritzl-6.1 --drone 0 --over mqtt --key \
                        team.key\n  \
                        foxhunt node fusion pritzl-6.1 --over mqtt --key team.key --log \
                        out/net.jsonl --resume"
)]
pub struct Args {
    #[command(subcommand)]
    node: Node,
}

/// Part of a hunt.
#[derive(Debug, clap::Subcommand)]
enum Node {
    Drone(drone::Args),
    Fusion(Box<fusion::Args>),
    Key(over::KeyArgs),
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    match &args.node {
        Node::Drone(args) => drone::run(args, context),
        Node::Fusion(args) => fusion::run(args, context),
        Node::Key(args) => over::make_key(args, context.output),
    }
}
