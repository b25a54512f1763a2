use foxhunt_core::BeaconId;

use super::StepperConfig;

/// A turn that is under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turn {
    /// Whose signal is listened for.
    pub(super) beacon: BeaconId,
    /// How many positions are done.
    pub(super) done: u16,
    /// The antenna goes from the last position to the first.
    pub(super) backwards: bool,
    /// When the present position's time is up; `None` until the first order.
    pub(super) deadline: Option<f64>,
    /// What the source waits for.
    pub(super) phase: Phase,
}

/// What the source does next at a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Phase {
    /// Order the rotator to turn.
    Order,
    /// Wait until it stands.
    Turn,
    /// Ask the radio: the antenna stands at `angle`, `answers` have come.
    Ask { angle: f64, answers: u16 },
    /// Wait for the radio's answer.
    Listen { angle: f64, answers: u16 },
    /// An answer came; ask the vehicle where that was.
    Locate { angle: f64, answers: u16, rss_dbm: f64, time: f64 },
    /// All positions are done; ask the vehicle where it is if no sample says it.
    Finish { time: f64 },
}

impl Turn {
    pub(super) fn new(beacon: BeaconId, backwards: bool) -> Self {
        Self { beacon, done: 0, backwards, deadline: None, phase: Phase::Order }
    }

    /// The position that the antenna is at or on its way to, of so many.
    pub(super) fn position(&self, positions: u16) -> u16 {
        let last = positions.saturating_sub(1);
        let forwards = self.done.min(last);
        if self.backwards { last - forwards } else { forwards }
    }

    /// Goes on to the next position, or ends the turn after the last. The next order follows at
    /// once, so its time begins now, whether the rotator takes it or not.
    pub(super) fn next(&mut self, config: &StepperConfig, now: f64) {
        self.done += 1;
        self.deadline = Some(now + config.position_timeout());
        let more = self.done < config.positions();
        self.phase = if more { Phase::Order } else { Phase::Finish { time: now } };
    }
}
