//! One file or folder for each subcommand, with its arguments, its work and its table; and parts
//! that several of them share.

#[cfg(feature = "hardware")]
mod advice;
mod antenna;
mod bearing;
mod calibrate;
mod calibration;
mod calibration_report;
mod campaign;
mod choice;
mod compare;
mod completions;
mod convert;
mod cot;
#[cfg(feature = "hardware")]
mod devices;
#[cfg(feature = "hardware")]
mod emulate;
mod fixes;
mod fleets;
#[cfg(feature = "hardware")]
mod flight_plan;
#[cfg(feature = "hardware")]
mod fly;
mod hunt;
mod judge;
mod list;
mod listen;
mod live;
mod locate;
mod locating;
mod man;
mod mqtt;
#[cfg(feature = "hardware")]
mod node;
mod notices;
#[cfg(not(target_family = "wasm"))]
mod page;
mod parameters;
mod plot;
mod pulses;
mod recorded;
mod replay;
#[cfg(feature = "store")]
mod results;
mod scores;
mod settings;
mod soak;
#[cfg(feature = "store")]
mod storing;
mod tags;
mod tiles;
#[cfg(feature = "hardware")]
mod tone;
mod views;

use clap::Subcommand;

use crate::{
    error::CliError,
    output::{Context, count_warnings},
};

/// The subcommands, each with its file.
#[derive(Debug, Subcommand)]
pub enum Command {
    Hunt(hunt::Args),
    Campaign(campaign::Args),
    Compare(compare::Args),
    #[cfg(feature = "store")]
    Results(results::Args),
    Fleets(fleets::Args),
    Soak(soak::Args),
    List(list::Args),
    Replay(replay::Args),
    Calibrate(calibrate::Args),
    Locate(Box<locate::Args>),
    Judge(judge::Args),
    Bearing(bearing::Args),
    Antenna(antenna::Args),
    Tags(tags::Args),
    Pulses(pulses::Args),
    Listen(listen::Args),
    Convert(convert::Args),
    Plot(plot::Args),
    Completions(completions::Args),
    Man(man::Args),
    // The program in the page cannot hold itself.
    #[cfg(not(target_family = "wasm"))]
    Page(page::Args),
    #[cfg(feature = "hardware")]
    Fly(fly::Args),
    #[cfg(feature = "hardware")]
    Devices(devices::Args),
    #[cfg(feature = "hardware")]
    Emulate(emulate::Args),
    #[cfg(feature = "hardware")]
    Node(node::Args),
    /// Fly a hunt on real devices; not in this build
    #[cfg(not(feature = "hardware"))]
    Fly(AnyArguments),
    /// Check attached devices; not in this build
    #[cfg(not(feature = "hardware"))]
    Devices(AnyArguments),
    /// Emulate the devices of a simulated field; not in this build
    #[cfg(not(feature = "hardware"))]
    Emulate(AnyArguments),
    /// Run one computer's part of a hunt; not in this build
    #[cfg(not(feature = "hardware"))]
    Node(AnyArguments),
}

#[cfg(not(feature = "hardware"))]
/// The arguments of a command that is not in this build: anything.
#[derive(Debug, clap::Args)]
pub struct AnyArguments {
    /// Arguments of the command.
    #[arg(
        trailing_var_arg = true,
        allow_hyphen_values = true,
        hide = true,
        value_name = "ARGUMENTS"
    )]
    arguments: Vec<String>,
}

#[cfg(not(feature = "hardware"))]
impl AnyArguments {
    /// Names the features that the command needs, and how to build with them.
    fn refuse(&self, command: &str, features: &str) -> Result<(), CliError> {
        let words = [&[command.to_owned()], self.arguments.as_slice()].concat().join(" ");
        Err(CliError::input(format!(
            "`{words}` needs a build with --features {features}: {}, or in the repository `cargo \
             run --release -p foxhunt-cli --features {features} -- {words}`",
            crate::hints::build(features)
        )))
    }
}

/// Runs a subcommand.
pub fn run(command: Command, context: Context<'_>) -> Result<(), CliError> {
    let ended = dispatch(command, context);
    count_warnings();
    ended
}

fn dispatch(command: Command, context: Context<'_>) -> Result<(), CliError> {
    match command {
        Command::Hunt(args) => hunt::run(&args, context),
        Command::Campaign(args) => campaign::run(&args, context),
        Command::Compare(args) => compare::run(&args, context),
        #[cfg(feature = "store")]
        Command::Results(args) => results::run(&args, context.output),
        Command::Fleets(args) => fleets::run(&args, context),
        Command::Soak(args) => soak::run(&args, context),
        Command::List(args) => list::run(&args, context),
        Command::Replay(args) => replay::run(&args, context),
        Command::Calibrate(args) => calibrate::run(&args, context),
        Command::Locate(args) => locate::run(&args, context),
        Command::Judge(args) => judge::run(&args, context),
        Command::Bearing(args) => bearing::run(&args, context),
        Command::Antenna(args) => antenna::run(&args, context.output),
        Command::Tags(args) => tags::run(&args, context),
        Command::Pulses(args) => pulses::run(&args, context),
        Command::Listen(args) => listen::run(&args, context),
        Command::Convert(args) => convert::run(&args, context),
        Command::Plot(args) => plot::run(&args, context),
        Command::Completions(args) => completions::run(&args, context),
        Command::Man(args) => man::run(&args, context),
        #[cfg(not(target_family = "wasm"))]
        Command::Page(args) => page::run(&args, context),
        #[cfg(feature = "hardware")]
        Command::Fly(args) => fly::run(&args, context),
        #[cfg(feature = "hardware")]
        Command::Devices(args) => devices::run(&args, context.output),
        #[cfg(feature = "hardware")]
        Command::Emulate(args) => emulate::run(&args, context.output),
        #[cfg(feature = "hardware")]
        Command::Node(args) => node::run(&args, context),
        #[cfg(not(feature = "hardware"))]
        Command::Fly(args) => args.refuse("fly", "hardware"),
        #[cfg(not(feature = "hardware"))]
        Command::Devices(args) => args.refuse("devices", "hardware"),
        #[cfg(not(feature = "hardware"))]
        Command::Emulate(args) => args.refuse("emulate", "hardware"),
        #[cfg(not(feature = "hardware"))]
        Command::Node(args) => args.refuse("node", "hardware"),
    }
}
