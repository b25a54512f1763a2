//! One file for each subcommand: its arguments, what it does, its table.

pub(crate) mod antenna;
pub(crate) mod bearing;
pub(crate) mod calibrate;
pub(crate) mod campaign;
#[cfg(feature = "hardware")]
pub(crate) mod devices;
#[cfg(feature = "hardware")]
pub(crate) mod emulate;
pub(crate) mod estimators;
pub(crate) mod extractors;
#[cfg(feature = "hardware")]
pub(crate) mod fly;
pub(crate) mod hunt;
pub(crate) mod locate;
#[cfg(feature = "hardware")]
pub(crate) mod node;
pub(crate) mod planners;
pub(crate) mod replay;
pub(crate) mod scenarios;

mod antennas;
mod bearing_campaign;
mod calibration;
mod calibration_report;
mod choice;
mod extraction;
mod fixes;
mod fleets_campaign;
#[cfg(feature = "hardware")]
mod flight_plan;
mod overrides;
mod parameter;
mod planners_campaign;
mod planning;
mod recorded;
mod telling;

use crate::{args::Command, error::CliError, output::Output};

/// Runs a subcommand.
pub(crate) fn run(command: Command, output: Output) -> Result<(), CliError> {
    match command {
        Command::Hunt(args) => hunt::run(&args, output),
        Command::Campaign(args) => campaign::run(&args, output),
        Command::Scenarios(args) => scenarios::run(&args, output),
        Command::Estimators(args) => estimators::run(&args, output),
        Command::Extractors(args) => extractors::run(&args, output),
        Command::Planners(args) => planners::run(&args, output),
        Command::Replay(args) => replay::run(&args, output),
        Command::Calibrate(args) => calibrate::run(&args, output),
        Command::Locate(args) => locate::run(&args, output),
        Command::Bearing(args) => bearing::run(&args, output),
        Command::Antenna(args) => antenna::run(&args, output),
        #[cfg(feature = "hardware")]
        Command::Fly(args) => fly::run(&args, output),
        #[cfg(feature = "hardware")]
        Command::Devices(args) => devices::run(&args, output),
        #[cfg(feature = "hardware")]
        Command::Emulate(args) => emulate::run(&args, output),
        #[cfg(feature = "hardware")]
        Command::Node(args) => node::run(&args, output),
    }
}
