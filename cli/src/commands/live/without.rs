use foxhunt::{hunt::Event, overview::KeptTurn};

use super::{LivePlan, Shown};
use crate::error::CliError;

/// A view that is not in this build: nothing makes one, since
/// [`LiveArgs::plan`](super::LiveArgs::plan) refuses it.
#[derive(Debug)]
pub(in crate::commands) enum LiveView {}

impl LiveView {
    pub(in crate::commands) fn start(_: LivePlan, _: &Shown<'_>) -> Result<Self, CliError> {
        Err(CliError::input("--live is not in this build"))
    }

    pub(in crate::commands) fn show(&self, _: &Event, _: &[KeptTurn]) {
        match *self {}
    }

    pub(in crate::commands) fn stay(self, _: impl Fn() -> bool) {
        match self {}
    }
}
