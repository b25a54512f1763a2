use std::{
    fs,
    path::{Path, PathBuf},
};

use clap::Command;
use clap_mangen::Man;

use crate::{error::CliError, output::Context};

/// Write the manual pages
///
/// Writes a page in roff for the program and for each of its commands, with the texts of `--help`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt man ~/.local/share/man/man1\n  man foxhunt-hunt")]
pub struct Args {
    /// The folder for foxhunt.1, foxhunt-hunt.1 and so on
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let folder = &args.folder;
    fs::create_dir_all(folder).map_err(|error| CliError::writing(folder, error))?;
    let mut command = (context.command_line)(context.registry).disable_help_subcommand(true);
    command.build();
    let mut written = Vec::new();
    write(command, folder, &mut written)?;
    let count = written.len();
    context.output.result(&written, |_| format!("{count} pages: {}", folder.display()))
}

/// Writes the pages of a command and of its subcommands.
fn write(command: Command, folder: &Path, written: &mut Vec<PathBuf>) -> Result<(), CliError> {
    let subcommands: Vec<Command> = command.get_subcommands().cloned().collect();
    let man = Man::new(command);
    let path = folder.join(man.get_filename());
    let mut page = Vec::new();
    man.render(&mut page).map_err(CliError::failure)?;
    fs::write(&path, page).map_err(|error| CliError::writing(&path, error))?;
    written.push(path);
    subcommands.into_iter().try_for_each(|subcommand| write(subcommand, folder, written))
}
