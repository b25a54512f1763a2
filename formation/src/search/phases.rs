use core::fmt;

use foxhunt_core::{Decision, Outcome, Stage};

/// The phase of a formation's search (Pritzl 2018, §5.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(tag = "name", content = "detail", rename_all = "snake_case"))]
pub enum Phase {
    /// Waiting for a target.
    #[default]
    Idle,
    /// Forming up around where the drones were.
    Start,
    /// On the way to the next places.
    Moving(Stage),
    /// At its places, antennas turning.
    Measuring(Stage),
    /// The target is done; another one may begin.
    Finished(Outcome),
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let stage = |stage: &Stage| match stage {
            Stage::Searching => "searching",
            Stage::Finishing => "finishing",
        };
        match self {
            Self::Idle => f.write_str("idle"),
            Self::Start => f.write_str("forming up"),
            Self::Moving(s) => write!(f, "moving, {}", stage(s)),
            Self::Measuring(s) => write!(f, "measuring, {}", stage(s)),
            Self::Finished(outcome) => write!(f, "finished, {outcome}"),
        }
    }
}

/// Event that moves a formation from one phase to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Signal {
    /// A target is to be searched.
    Begin,
    /// Every drone is at its place, or has used up its time to get there.
    Arrived,
    /// Every drone's turn is in or given up, and the planner has decided.
    Decided(Decision),
    /// The target is given up for a reason that the planner does not know.
    GivenUp(Outcome),
}

/// The phases of a search as a pure state machine: signals in, phases out, no clock, no I/O.
///
/// A signal that makes no sense in a phase is refused and changes nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Phases {
    phase: Phase,
}

impl Phases {
    /// The present phase; idle at first.
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Takes one signal and returns the phase that it leads to.
    ///
    /// # Errors
    ///
    /// [`PhaseError`] when the signal does not belong to the present phase.
    pub fn signal(&mut self, signal: Signal) -> Result<Phase, PhaseError> {
        self.phase = match (self.phase, signal) {
            (Phase::Idle | Phase::Finished(_), Signal::Begin) => Phase::Start,
            (Phase::Start, Signal::Arrived) => Phase::Measuring(Stage::Searching),
            (Phase::Moving(stage), Signal::Arrived) => Phase::Measuring(stage),
            (Phase::Measuring(_), Signal::Decided(Decision::Listen(stage))) => Phase::Moving(stage),
            (Phase::Measuring(_), Signal::Decided(Decision::Finish(outcome)))
            | (Phase::Start | Phase::Moving(_) | Phase::Measuring(_), Signal::GivenUp(outcome)) => {
                Phase::Finished(outcome)
            }
            (phase, signal) => return Err(PhaseError { phase, signal }),
        };
        Ok(self.phase)
    }
}

/// A signal that does not belong to the present phase.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{signal:?} makes no sense while {phase}")]
pub struct PhaseError {
    /// The phase, which stays.
    pub phase: Phase,
    /// The signal.
    pub signal: Signal,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_from_idle_to_the_second_target() {
        let mut phases = Phases::default();
        let script = [
            (Signal::Begin, Phase::Start),
            (Signal::Arrived, Phase::Measuring(Stage::Searching)),
            (Signal::Decided(Decision::Listen(Stage::Searching)), Phase::Moving(Stage::Searching)),
            (Signal::Arrived, Phase::Measuring(Stage::Searching)),
            (Signal::Decided(Decision::Listen(Stage::Finishing)), Phase::Moving(Stage::Finishing)),
            (Signal::Arrived, Phase::Measuring(Stage::Finishing)),
            (
                Signal::Decided(Decision::Finish(Outcome::Converged)),
                Phase::Finished(Outcome::Converged),
            ),
            (Signal::Begin, Phase::Start),
            (Signal::GivenUp(Outcome::NoSignal), Phase::Finished(Outcome::NoSignal)),
        ];
        for (signal, phase) in script {
            assert_eq!(phases.signal(signal), Ok(phase));
        }
    }

    #[test]
    fn what_makes_no_sense_changes_nothing() {
        let mut phases = Phases::default();
        let decided = Signal::Decided(Decision::Listen(Stage::Searching));
        for signal in [Signal::Arrived, decided, Signal::GivenUp(Outcome::MoveLimit)] {
            assert_eq!(phases.signal(signal), Err(PhaseError { phase: Phase::Idle, signal }));
        }
        assert_eq!(phases.signal(Signal::Begin), Ok(Phase::Start));
        assert!(phases.signal(Signal::Begin).is_err());
        assert!(phases.signal(decided).is_err());
        assert_eq!(phases.phase(), Phase::Start);
    }
}
