use clap::{Command, builder::PossibleValuesParser};
use clap_complete::{Shell, generate};

use crate::{error::CliError, output::Context};

/// Print a shell completion script
///
/// Prints a script for one shell that completes the commands, flags and names of this build.
/// `foxhunt man` writes manual pages.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
                  foxhunt completions bash > ~/.local/share/bash-completion/completions/foxhunt\n  \
                  foxhunt completions zsh > ~/.zfunc/_foxhunt\n  \
                  foxhunt completions fish > ~/.config/fish/completions/foxhunt.fish")]
pub struct Args {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let mut command = with_every_estimator((context.command_line)(context.registry));
    let name = command.get_name().to_owned();
    let mut script = Vec::new();
    generate(args.shell, &mut command, name, &mut script);
    let script = String::from_utf8(script).map_err(CliError::failure)?;
    context.output.verbatim(&script)
}

/// Shows the estimators, too, that help texts leave out.
fn with_every_estimator(command: Command) -> Command {
    command
        .mut_args(|arg| {
            if arg.get_id() != "estimator" {
                return arg;
            }
            let values = arg.get_possible_values().into_iter().map(|value| value.hide(false));
            let values = PossibleValuesParser::new(values.collect::<Vec<_>>());
            arg.value_parser(values)
        })
        .mut_subcommands(with_every_estimator)
}
