use super::StepperConfig;
use crate::turn_goal::between_steps;

/// A turn that is under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turn {
    /// How many beacons are listened for at each position.
    beacons: usize,
    /// Which of them is interrogated at present, below `beacons`.
    pub(super) beacon: usize,
    /// How many positions are done, of all rounds.
    pub(super) done: u32,
    /// The antenna goes from the last position to the first, in the first round.
    pub(super) backwards: bool,
    /// When the first order was tried.
    pub(super) begun: Option<f64>,
    /// When the time of this beacon at the present position is up; `None` until the first order.
    pub(super) deadline: Option<f64>,
    /// What the source waits for.
    pub(super) phase: Phase,
}

/// What the source does next at a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Phase {
    /// There is no turn, or it is over.
    Idle,
    /// Order the rotator to turn.
    Order,
    /// Wait until it stands.
    Turn,
    /// Send a request by the radio: the antenna stands at `angle`, `answers` have come.
    Request { angle: f64, answers: u16 },
    /// Wait for the radio's answer.
    Await { angle: f64, answers: u16 },
    /// Answers came, the last `new` ones; poll the vehicle for where that was. Whether the next one
    /// is already waited for.
    Locate { angle: f64, answers: u16, new: u16, awaits: bool },
    /// All positions are done; poll the vehicle for its pose if there is no sample.
    Finish { time: f64 },
}

impl Turn {
    /// A turn that begins, if there are any beacons.
    pub(super) fn new(beacons: usize, backwards: bool) -> Self {
        let phase = if beacons > 0 { Phase::Order } else { Phase::Idle };
        Self { beacons, beacon: 0, done: 0, backwards, begun: None, deadline: None, phase }
    }

    /// The position that the antenna is at or on its way to, of so many; between them in all
    /// rounds but the first.
    pub(super) fn position(&self, positions: u16) -> f64 {
        let positions = u32::from(positions.max(1));
        let (round, done) = (self.done / positions, self.done % positions);
        let backwards = self.backwards != (round % 2 == 1);
        f64::from(if backwards { positions - 1 - done } else { done }) + between_steps(round)
    }

    /// How many beacons are listened for, as a number to reckon with.
    #[expect(clippy::cast_precision_loss, reason = "there are a few")]
    pub(super) fn beacons(&self) -> f64 {
        self.beacons as f64
    }

    /// Goes on to the next beacon, after the last to the next position, or ends the turn after
    /// the last of these. What is done next follows at once, so its time begins now, whether the
    /// device takes it or not.
    pub(super) fn next(&mut self, config: &StepperConfig, now: f64) {
        self.deadline = Some(now + config.position_timeout());
        self.beacon += 1;
        if let Some(angle) = self.standing()
            && self.beacon < self.beacons
        {
            self.phase = Phase::Request { angle, answers: 0 };
            return;
        }
        self.beacon = 0;
        self.done += 1;
        let more = self.done < u32::from(config.positions());
        self.phase = if more { Phase::Order } else { Phase::Finish { time: now } };
    }

    /// Where the antenna stands, if it has come to a standstill.
    fn standing(&self) -> Option<f64> {
        match self.phase {
            Phase::Request { angle, .. }
            | Phase::Await { angle, .. }
            | Phase::Locate { angle, .. } => Some(angle),
            Phase::Idle | Phase::Order | Phase::Turn | Phase::Finish { .. } => None,
        }
    }
}
