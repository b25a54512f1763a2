//! The figures of papers.

mod contenders;
mod drawing;
mod hunts;
mod recordings;

use crate::{error::CliError, output::Context};

/// Draw figures of hunts, recordings and comparisons
///
/// Each kind of figure is a command of its own. `docs/figures.md` lists the figures of the two
/// reference documents with the command that draws each.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt plot error out/hunt.jsonl --out error.svg\n  \
                        foxhunt plot pattern turns.csv --turn 3 --out pattern.svg\n  \
                        foxhunt plot rssi flight.csv --truth 50.0755,14.4378 --out rssi.svg\n  \
                        foxhunt plot planners planners.json --out planners.svg")]
pub struct Args {
    #[command(subcommand)]
    kind: Kind,
}

/// The kinds of figures.
#[derive(Debug, clap::Subcommand)]
enum Kind {
    /// The drones, their bearings, and the estimates of a hunt
    Trajectory(hunts::OneLog),
    /// The error of the estimate after each reception
    Error(hunts::Logs),
    /// The semi-axes of the 95 % ellipse after each reception
    Axes(hunts::Logs),
    /// The NEES after each reception, averaged over logs of one scenario, with its χ² band
    Nees(hunts::Logs),
    /// The cloud of a particle filter at six moments of a hunt
    Cloud(hunts::OneLog),
    /// The radiation pattern of a recorded turn, as received and preprocessed
    Pattern(recordings::OneTurn),
    /// The received levels over time, by receiver
    Levels(recordings::Received),
    /// The level over the distance to a known transmitter, by height, with the fitted path loss
    Rssi(recordings::Measured),
    /// The errors of bearings, with the fitted mixture of a normal and outliers
    BearingErrors(recordings::Measured),
    /// The phases of a search and the signals between them, with the ways that a hunt went
    Phases(hunts::Machine),
    /// The comparison of planners that `compare planners --json` printed
    Planners(contenders::Planners),
    /// The distributions of errors and NEES of the contenders of a store
    #[cfg(feature = "store")]
    Distributions(contenders::Distributions),
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    match &args.kind {
        Kind::Trajectory(args) => hunts::trajectory(args, context),
        Kind::Error(args) => hunts::error(args, context),
        Kind::Axes(args) => hunts::axes(args, context),
        Kind::Nees(args) => hunts::nees(args, context),
        Kind::Cloud(args) => hunts::cloud(args, context),
        Kind::Pattern(args) => recordings::pattern(args, context),
        Kind::Levels(args) => recordings::levels(args, context.output),
        Kind::Rssi(args) => recordings::rssi(args, context),
        Kind::BearingErrors(args) => recordings::bearing_errors(args, context),
        Kind::Phases(args) => hunts::phases(args, context.output),
        Kind::Planners(args) => contenders::planners(args, context.output),
        #[cfg(feature = "store")]
        Kind::Distributions(args) => contenders::distributions(args, context.output),
    }
}
