use std::path::PathBuf;

use foxhunt::hardware::link::{KeyError, TeamKey};
use serde::Serialize;

use crate::{error::CliError, output::Output};

/// Make the key that all nodes of a team share
///
/// Copy the file to every computer over a channel that you trust, such as scp. Anyone who has it
/// can fly the drones. Only its owner may read it.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The file to write; an existing one is refused
    file: PathBuf,
}

/// The file that was written.
#[derive(Serialize)]
struct Made<'a> {
    key: &'a str,
}

pub(super) fn run(args: &Args, output: Output) -> Result<(), CliError> {
    let key = TeamKey::generate().map_err(CliError::failure)?;
    key.write(&args.file).map_err(key_error)?;
    let made = args.file.display().to_string();
    output.result(&Made { key: &made }, |made| format!("key: {}", made.key))
}

/// Returns the error of a key that cannot be made or read.
pub(super) fn key_error(error: KeyError) -> CliError {
    match error {
        KeyError::Random(_) => CliError::failure(error),
        _ => CliError::input(error),
    }
}
