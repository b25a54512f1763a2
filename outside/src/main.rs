//! The program `foxhunt` with this crate's parts in it.

use std::process::ExitCode;

fn main() -> ExitCode {
    foxhunt_cli::run(foxhunt_outside::registry())
}
