//! The `foxhunt` program.

mod args;
mod commands;
mod error;
mod output;
mod progress;
mod table;

use std::process::ExitCode;

use clap::Parser;

use crate::{args::Cli, output::Output};

fn main() -> ExitCode {
    let Cli { json, command } = Cli::parse();
    match commands::run(command, Output::new(json)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => error.report(),
    }
}
