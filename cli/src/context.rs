use foxhunt::registry::Registry;

use crate::output::Output;

/// Inputs of every command besides its own arguments.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Context<'a> {
    /// Output for results and notes.
    pub(crate) output: Output<'a>,
    /// The estimators, extractors, planners and sources, by name.
    pub(crate) registry: &'a Registry,
    /// All commands, their arguments with the names of a registry.
    pub(crate) command_line: fn(&Registry) -> clap::Command,
}
