//! The program `foxhunt` as a library: the same commands over your own registry.
//!
//! Each registered part has a name in every command: in `--help`, in `list`, for `hunt`,
//! `campaign`, `compare`, `replay` and `locate`. A program with an estimator of its own is this:
//!
//! ```no_run
//! use std::process::ExitCode;
//!
//! use foxhunt::{
//!     config::{FilterConfig, GateConfig},
//!     registry::Registry,
//! };
//!
//! fn main() -> ExitCode {
//!     let registry = Registry::builtin();
//!     let ekf = registry.estimator("ekf").expect("it is built in");
//!     let ungated = ekf.with_settings("filter", |settings| {
//!         settings.filter = FilterConfig::Ekf { gate: GateConfig::Open, iterations: 1 };
//!     });
//!     let mut ungated = ungated.expect("it has settings");
//!     ungated.name = "ekf-ungated".into();
//!     foxhunt_cli::run(registry.with_estimator(ungated))
//! }
//! ```

#![expect(unreachable_pub, reason = "what a program shares among its modules is no library")]

mod args;
mod commands;
mod error;
mod hints;
mod output;
mod progress;
mod screen;
mod table;

use std::{cell::RefCell, env, ffi::OsString, process::ExitCode};

use foxhunt::registry::Registry;

pub use crate::error::CommandError;
use crate::output::{Context, Output};

/// Runs the program on its command line and returns its exit code: 0 for success, 2 for wrong use
/// or input, 1 for a failure.
///
/// `--estimator`, `--extractor` and `--planner` take the names in the registry.
#[must_use]
pub fn run(registry: Registry) -> ExitCode {
    let parsed = args::parse(&registry, env::args_os());
    let args::Cli { json, command } = parsed.unwrap_or_else(|error| error.exit());
    let context =
        Context { output: Output::new(json), registry: &registry, command_line: args::command };
    match commands::run(command, context) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => error.report(),
    }
}

/// Runs one command, such as `["locate", "flight.csv"]`, and returns what it prints with `--json`;
/// nothing is printed on standard output, and the program never ends. Warnings and progress are on
/// standard error.
///
/// For bindings to other languages; Rust programs use the crate `foxhunt`.
///
/// # Errors
///
/// The error that the program would print: see [`CommandError`].
pub fn run_json(
    registry: &Registry,
    arguments: impl IntoIterator<Item = OsString>,
) -> Result<String, CommandError> {
    let arguments = [OsString::from("foxhunt")].into_iter().chain(arguments);
    let parsed = args::parse(registry, arguments);
    let cli = parsed.map_err(|error| {
        let text = error.to_string();
        // A mistake stands before the usage of a command line, which callers do not have.
        let mistake = if error.exit_code() == 0 { &text } else { without_usage(&text) };
        let mistake = mistake.strip_prefix("error: ").unwrap_or(mistake);
        CommandError::Input(mistake.trim_end().to_owned())
    })?;
    let json = RefCell::new(String::new());
    let output = Output::kept_in(&json);
    let context = Context { output, registry, command_line: args::command };
    commands::run(cli.command, context)?;
    Ok(json.into_inner())
}

/// Runs one command as [`run_json`] does, and returns the lines for standard error, too, which it
/// does not print.
pub fn run_json_overheard(
    registry: &Registry,
    arguments: impl IntoIterator<Item = OsString>,
) -> (Result<String, CommandError>, Vec<String>) {
    output::overheard(|| run_json(registry, arguments))
}

/// The text before `Usage:` and the advice to try `--help`.
fn without_usage(text: &str) -> &str {
    let ends = ["\n\nUsage:", "\n\nFor more information"].map(|end| text.find(end));
    let end = ends.into_iter().flatten().min();
    end.map_or(text, |end| &text[..end])
}

/// The commands with their arguments, as JSON: words, help, and for each argument its name, help,
/// type, choices and default.
///
/// For bindings to other languages, which make functions of them.
///
/// # Errors
///
/// None that is known: the description is plain data.
pub fn commands_json(registry: &Registry) -> Result<String, CommandError> {
    serde_json::to_string(&args::described(args::command(registry)))
        .map_err(|error| CommandError::Failure(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run_words(words: &str) -> Result<String, CommandError> {
        run_json(&Registry::builtin(), words.split(' ').map(OsString::from))
    }

    #[test]
    fn a_result_is_json() {
        let json = run_words("list scenarios").expect("a command");
        let list: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        assert!(list.as_array().is_some_and(|list| !list.is_empty()), "{json}");
    }

    #[test]
    fn what_is_wrong_is_named() {
        let Err(CommandError::Input(text)) = run_words("campaign no-such-scenario --runs 1") else {
            panic!("there is none")
        };
        assert!(text.contains("no-such-scenario"), "{text}");
        let Err(CommandError::Input(text)) = run_words("hunt --no-such-flag") else {
            panic!("there is none")
        };
        assert!(text.contains("--no-such-flag"), "{text}");
        assert!(!text.contains("--help") && !text.contains("Usage"), "{text}");
    }
}
