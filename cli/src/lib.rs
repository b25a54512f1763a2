//! The program `foxhunt` as a library: the same commands over a registry of one's own.
//!
//! What is registered has a name in every command: in `--help`, in `list`, for `hunt`, `campaign`,
//! `compare`, `replay` and `locate`. A program with an estimator of its own is this:
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

mod args;
mod commands;
mod context;
mod error;
mod hints;
mod output;
mod progress;
mod table;

use std::process::ExitCode;

use foxhunt::registry::Registry;

use crate::{args::Cli, context::Context, output::Output};

/// Runs the program on its command line, and returns what it ends with: 0 for success, 2 for wrong
/// use or input, 1 for a failure.
///
/// The names in the registry are what `--estimator`, `--extractor` and `--planner` take.
#[must_use]
pub fn run(registry: Registry) -> ExitCode {
    let Cli { json, command } = args::parse(&registry);
    let context = Context { output: Output::new(json), registry: &registry };
    match commands::run(command, context) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => error.report(),
    }
}
