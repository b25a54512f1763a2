use clap_complete::{Shell, generate};

use crate::{context::Context, error::CliError};

/// Print a shell completion script
///
/// Prints a script for one shell that completes the commands, flags and names of this build.
/// `foxhunt man` writes manual pages.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
                  foxhunt completions bash > ~/.local/share/bash-completion/completions/foxhunt\n  \
                  foxhunt completions zsh > ~/.zfunc/_foxhunt\n  \
                  foxhunt completions fish > ~/.config/fish/completions/foxhunt.fish")]
pub(crate) struct Args {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

pub(crate) fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let mut command = (context.command_line)(context.registry);
    let name = command.get_name().to_owned();
    let mut script = Vec::new();
    generate(args.shell, &mut command, name, &mut script);
    let script = String::from_utf8(script).map_err(CliError::failure)?;
    context.output.verbatim(&script)
}
