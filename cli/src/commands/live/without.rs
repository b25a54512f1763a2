use foxhunt::{hunt::Event, overview::KeptTurn};

use super::{LivePlan, Shown};
use crate::error::CliError;

/// A view that is not in this build: nothing makes one, since
/// [`LiveArgs::plan`](super::LiveArgs::plan) refuses it.
#[derive(Debug)]
pub enum LiveView {}

impl LiveView {
    pub fn start(_: LivePlan, _: &Shown<'_>) -> Result<Self, CliError> {
        Err(CliError::input("--live is not in this build"))
    }

    pub fn show(&self, _: &Event, _: &[KeptTurn]) {
        match *self {}
    }

    pub fn stay(self, _: impl Fn() -> bool) {
        match self {}
    }
}
