//! The `foxhunt` program.

use std::process::ExitCode;

use foxhunt::registry::Registry;

fn main() -> ExitCode {
    foxhunt_cli::run(Registry::builtin())
}
