//! The command line, and the names that its arguments take.

mod description;
#[cfg(all(test, feature = "full"))]
mod documented;
mod groups;
mod names;

use std::ffi::OsString;

use clap::{CommandFactory, FromArgMatches, Parser};
use foxhunt::registry::Registry;

use crate::{commands::Command, hints, output::JsonForm};

pub use description::described;

/// Finds radio transmitters with drones.
///
/// A directional antenna turns under each drone. The received power over one turn gives a level and
/// a bearing, an estimator fuses them, and the formation moves to where the next turn is expected
/// to shrink the ellipse most. Simulates hunts, compares estimators over thousands of them, replays
/// logs, and works on recorded flights.
#[derive(Debug, Parser)]
#[command(
    name = PROGRAM,
    version,
    propagate_version = true,
    after_help = "Exit code: 0 success, 2 wrong use or input, 1 a failure.\n\n\
                  Example: fly the default hunt and look at out/hunt.svg\n  foxhunt hunt"
)]
pub struct Cli {
    /// Print the result as one JSON value on standard output, all else on standard error;
    /// `--json=lines` prints a value per line: the events of long work, then the result
    #[arg(long, global = true, value_name = "FORM", num_args = 0..=1, require_equals = true,
          default_missing_value = "value")]
    pub json: Option<JsonForm>,
    /// Command to run.
    #[command(subcommand)]
    pub command: Command,
}

/// Name of the program.
const PROGRAM: &str = "foxhunt";

/// All commands, their arguments with the names of a registry.
pub fn command(registry: &Registry) -> clap::Command {
    names::command(groups::grouped(Cli::command()), registry)
}

/// Parses a command line; its first word is the program's name.
///
/// # Errors
///
/// The requested help, or the mistake with a hint.
pub fn parse(
    registry: &Registry,
    arguments: impl IntoIterator<Item = OsString>,
) -> Result<Cli, clap::Error> {
    command(registry)
        .try_get_matches_from(arguments)
        .and_then(|matches| Cli::from_arg_matches(&matches))
        .map_err(|error| hints::with_hint(error, registry))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        command(&Registry::builtin()).debug_assert();
    }
}
