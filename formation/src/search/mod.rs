//! A search as a whole: its phases, and when it is over.

mod phases;
mod stop;

pub use phases::{Phase, PhaseError, Phases, Signal};
pub use stop::{Progress, Stop, StopRules, StopWatch};
