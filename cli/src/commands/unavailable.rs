use crate::{error::CliError, hints};

/// The arguments of a command that is not in this build: anything.
#[derive(Debug, clap::Args)]
pub(crate) struct AnyArguments {
    /// Arguments of the command.
    #[arg(
        trailing_var_arg = true,
        allow_hyphen_values = true,
        hide = true,
        value_name = "ARGUMENTS"
    )]
    arguments: Vec<String>,
}

impl AnyArguments {
    /// Names the features that the command needs, and how to build with them.
    pub(crate) fn refuse(&self, command: &str, features: &str) -> Result<(), CliError> {
        let words = [&[command.to_owned()], self.arguments.as_slice()].concat().join(" ");
        Err(CliError::input(format!(
            "`{words}` needs a build with --features {features}: {}, or in the repository `cargo \
             run --release -p foxhunt-cli --features {features} -- {words}`",
            hints::build(features)
        )))
    }
}
