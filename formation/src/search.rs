//! The phases of a search, and the rules that end it.

use core::fmt;

use foxhunt_core::{
    Decision, Estimate, Outcome, Stage,
    parameter::{ParameterError, positive},
};
use nalgebra::Vector2;

/// Number of positions in a row that have to teach too little: one may be bad luck.
const POOR: u32 = 2;

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

impl fmt::Display for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Begin => f.write_str("a target begins"),
            Self::Arrived => f.write_str("all arrived"),
            Self::Decided(Decision::Listen(Stage::Searching)) => f.write_str("decided: search on"),
            Self::Decided(Decision::Listen(Stage::Finishing)) => f.write_str("decided: finish"),
            Self::Decided(Decision::Finish(_)) => f.write_str("decided: done"),
            Self::GivenUp(_) => f.write_str("given up"),
        }
    }
}

/// A step from one phase to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition {
    /// The phase before.
    pub from: Phase,
    /// Signal that leads on.
    pub signal: Signal,
    /// The phase after.
    pub to: Phase,
}

/// Every phase; one outcome stands for all.
const PHASES: [Phase; 7] = [
    Phase::Idle,
    Phase::Start,
    Phase::Moving(Stage::Searching),
    Phase::Measuring(Stage::Searching),
    Phase::Moving(Stage::Finishing),
    Phase::Measuring(Stage::Finishing),
    Phase::Finished(Outcome::Converged),
];

/// Every signal; one outcome stands for all.
const SIGNALS: [Signal; 6] = [
    Signal::Begin,
    Signal::Arrived,
    Signal::Decided(Decision::Listen(Stage::Searching)),
    Signal::Decided(Decision::Listen(Stage::Finishing)),
    Signal::Decided(Decision::Finish(Outcome::Converged)),
    Signal::GivenUp(Outcome::Converged),
];

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

    /// Every transition of the machine, found by giving it each signal in each phase. One outcome
    /// stands for all.
    pub fn transitions() -> impl Iterator<Item = Transition> {
        PHASES.into_iter().flat_map(|from| {
            SIGNALS.into_iter().filter_map(move |signal| {
                let to = Self { phase: from }.signal(signal).ok()?;
                Some(Transition { from, signal, to })
            })
        })
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
#[error("the signal \"{signal}\" is not possible while {phase}")]
pub struct PhaseError {
    /// The phase, which stays.
    pub phase: Phase,
    /// The signal.
    pub signal: Signal,
}

/// Rules that end the search for a target, besides the rule of its planner. A rule that is absent
/// stops nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct StopRules {
    /// The semi-major axis of the ellipse that holds it with 95 % is below this.
    pub ellipse_95_m: Option<f64>,
    /// The last two formation positions each taught less than this, in nats per second of the time
    /// that they took: the entropy of the Gaussian with the belief's covariance fell more slowly.
    pub least_gain_nats_per_s: Option<f64>,
    /// A formation position moved the estimate by less than this, and `settled_positions` were
    /// measured: the rule of Pritzl 2018, §5.2.
    pub settled_m: Option<f64>,
    /// Number of positions measured before the estimate can have settled; 3 where absent.
    pub settled_positions: Option<u32>,
    /// This many seconds have passed since the search began.
    pub time_s: Option<f64>,
    /// All drones together have flown this far since the search began, in metres.
    pub path_m: Option<f64>,
    /// This many formation positions were measured.
    pub positions: Option<u32>,
}

/// Progress of a search after a formation position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Seconds since the search began.
    pub time_s: f64,
    /// Distance that all drones together have flown since then, in metres.
    pub path_m: f64,
    /// Number of formation positions measured.
    pub positions: u32,
    /// The present belief.
    pub estimate: Estimate<2>,
}

/// Reason that a search is over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Outcome of the search.
    pub outcome: Outcome,
    /// The figure that decided …
    pub value: f64,
    /// … and the rule's.
    pub limit: f64,
    rule: &'static str,
}

impl fmt::Display for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {:.4}, the limit is {:.4}", self.rule, self.value, self.limit)
    }
}

/// Holds one search against [`StopRules`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StopWatch {
    rules: StopRules,
    /// Time, entropy and place after the position before.
    before: Option<(f64, f64, Vector2<f64>)>,
    /// Number of positions in a row that taught too little.
    poor: u32,
}

impl StopWatch {
    /// For a search that begins.
    #[must_use]
    pub fn new(rules: StopRules) -> Self {
        Self { rules, before: None, poor: 0 }
    }

    /// Returns the reason that the search is over after one more formation position, if it is.
    pub fn check(&mut self, progress: &Progress) -> Option<Stop> {
        let Progress { time_s, path_m, positions, estimate } = *progress;
        // The entropy but for its constant: half the logarithm of the determinant.
        let entropy = 0.5 * libm::log(estimate.covariance.determinant());
        let before = self.before.replace((time_s, entropy, estimate.mean));
        let rules = &self.rules;

        let axis = estimate.ellipse(0.95).map(|ellipse| ellipse.semi_major);
        if let (Some(limit), Some(value)) = (rules.ellipse_95_m, axis)
            && value < limit
        {
            let rule = "semi-major axis in metres";
            return Some(Stop { outcome: Outcome::EllipseReached, value, limit, rule });
        }
        if let (Some(limit), Some((then, before, _))) = (rules.least_gain_nats_per_s, before) {
            let value = (before - entropy) / (time_s - then).max(f64::MIN_POSITIVE);
            self.poor = if value < limit { self.poor + 1 } else { 0 };
            if self.poor >= POOR {
                let rule = "information gained in nats per second";
                return Some(Stop { outcome: Outcome::LittleToLearn, value, limit, rule });
            }
        }
        if let (Some(limit), Some((_, _, before))) = (rules.settled_m, before) {
            let value = (estimate.mean - before).norm();
            if value < limit && positions >= rules.settled_positions.unwrap_or(3) {
                let rule = "the estimate moved by metres";
                return Some(Stop { outcome: Outcome::Converged, value, limit, rule });
            }
        }
        let limit = rules.positions.map(f64::from);
        if let Some(limit) = limit.filter(|limit| f64::from(positions) >= *limit) {
            let value = f64::from(positions);
            let rule = "formation positions";
            return Some(Stop { outcome: Outcome::MoveLimit, value, limit, rule });
        }
        rules.budget(time_s, path_m)
    }
}

impl StopRules {
    /// Returns the reason that a search is over after this time and path, whatever it has found.
    #[must_use]
    pub fn budget(&self, time_s: f64, path_m: f64) -> Option<Stop> {
        let budgets = [
            (self.time_s, time_s, "seconds since the search began"),
            (self.path_m, path_m, "metres flown since the search began"),
        ];
        budgets.into_iter().find_map(|(limit, value, rule)| {
            let limit = limit.filter(|limit| value >= *limit)?;
            Some(Stop { outcome: Outcome::BudgetSpent, value, limit, rule })
        })
    }

    /// Checks that the figure of every rule is a positive number.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first rule whose figure is not.
    pub fn check(&self) -> Result<(), ParameterError> {
        for (name, figure) in [
            ("ellipse_95_m", self.ellipse_95_m),
            ("least_gain_nats_per_s", self.least_gain_nats_per_s),
            ("settled_m", self.settled_m),
            ("settled_positions", self.settled_positions.map(f64::from)),
            ("time_s", self.time_s),
            ("path_m", self.path_m),
            ("positions", self.positions.map(f64::from)),
        ] {
            if let Some(figure) = figure {
                positive(name, figure)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::string::ToString;

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
    fn every_phase_is_reached_and_left() {
        let all: std::vec::Vec<Transition> = Phases::transitions().collect();
        for phase in PHASES {
            assert!(phase == Phase::Idle || all.iter().any(|step| step.to == phase), "{phase}");
            assert!(all.iter().any(|step| step.from == phase), "{phase}");
        }
        // Begin twice, arrive three times, decide three things in two phases, give up in five.
        assert_eq!(all.len(), 2 + 3 + 3 * 2 + 5);
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

    extern crate std;

    fn after(positions: u32, sigma: f64, east: f64) -> Progress {
        Progress {
            time_s: 60.0 * f64::from(positions),
            path_m: 20.0 * f64::from(positions),
            positions,
            estimate: Estimate::isotropic(Vector2::new(east, 0.0), sigma),
        }
    }

    fn stops(rules: StopRules, script: &[Progress]) -> Option<(usize, Outcome)> {
        let mut watch = StopWatch::new(rules);
        let mut stops = script.iter().enumerate();
        stops.find_map(|(index, progress)| Some((index, watch.check(progress)?.outcome)))
    }

    #[test]
    fn each_rule_by_its_own_figure() {
        let script = [
            after(1, 20.0, 30.0),
            after(2, 5.0, 9.0),
            after(3, 2.0, 5.5),
            after(4, 1.95, 5.0),
            after(5, 1.9, 4.9),
            after(6, 0.5, 4.7),
        ];
        let none = StopRules::default();
        assert_eq!(stops(none, &script), None);
        // 2.4477 σ below 4.7 m: σ below 1.920 m.
        let ellipse = StopRules { ellipse_95_m: Some(4.7), ..none };
        assert_eq!(stops(ellipse, &script), Some((4, Outcome::EllipseReached)));
        // From 2 m to 1.95 m and to 1.9 m: 2 ln(2 / 1.95) / 60 s = 8.4e-4 nats per second.
        let gain = StopRules { least_gain_nats_per_s: Some(9e-4), ..none };
        assert_eq!(stops(gain, &script), Some((4, Outcome::LittleToLearn)));
        let more = StopRules { least_gain_nats_per_s: Some(8e-4), ..none };
        assert_eq!(stops(more, &script), None);
        let settled = StopRules { settled_m: Some(1.0), ..none };
        assert_eq!(stops(settled, &script), Some((3, Outcome::Converged)));
        let later = StopRules { settled_positions: Some(6), ..settled };
        assert_eq!(stops(later, &script), Some((5, Outcome::Converged)));
        let time = StopRules { time_s: Some(170.0), ..none };
        assert_eq!(stops(time, &script), Some((2, Outcome::BudgetSpent)));
        let path = StopRules { path_m: Some(40.0), ..none };
        assert_eq!(stops(path, &script), Some((1, Outcome::BudgetSpent)));
        let positions = StopRules { positions: Some(1), ..none };
        assert_eq!(stops(positions, &script), Some((0, Outcome::MoveLimit)));
    }

    #[test]
    fn a_stop_is_explained() {
        let rules = StopRules { time_s: Some(50.0), ..StopRules::default() };
        let stop = StopWatch::new(rules).check(&after(1, 3.0, 0.0)).expect("60 s are over");
        let why = stop.to_string();
        assert_eq!(why, "seconds since the search began: 60.0000, the limit is 50.0000");
        let bad = StopRules { path_m: Some(f64::NAN), ..rules };
        assert_eq!(bad.check().map_err(|error| error.name), Err("path_m"));
        assert_eq!(rules.check(), Ok(()));
    }
}
