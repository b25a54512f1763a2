use foxhunt::{scenario::Scenario, sim::World};

use super::bench::{Field, Placed};
use crate::error::CliError;

/// An GNSS receiver
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub(super) field: Field,
}

pub(super) fn place(
    _args: &Args,
    _scenario: &Scenario,
    _world: &World,
) -> Result<Placed, CliError> {
    Err(CliError::failure("there is no emulated gnss yet"))
}
