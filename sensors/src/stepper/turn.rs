use super::StepperConfig;
use crate::turn_goal::between_steps;

/// A turn that is under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turn {
    /// Number of beacons listened for at each position.
    beacons: usize,
    /// Index of the beacon interrogated at present, below `beacons`.
    pub(super) beacon: usize,
    /// Number of positions done, of all rounds.
    pub(super) done: u32,
    /// The antenna goes from the last position to the first, in the first round.
    pub(super) backwards: bool,
    /// Time at which the first order was tried.
    pub(super) begun: Option<f64>,
    /// End of this beacon's time at the present position; `None` until the first order.
    pub(super) deadline: Option<f64>,
    /// Present phase of the turn.
    pub(super) phase: Phase,
}

/// Next action of the source at a position.
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
    /// Answers came, the last `new` ones; poll the vehicle for the place. `awaits` is true if the
    /// next one is already waited for.
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

    /// The position that the antenna is at or on its way to, of `positions`; between them in all
    /// rounds but the first.
    pub(super) fn position(&self, positions: u16) -> f64 {
        let positions = u32::from(positions.max(1));
        let round = self.done / positions;
        let done = self.done % positions;
        let backwards = self.backwards != (round % 2 == 1);
        f64::from(if backwards { positions - 1 - done } else { done }) + between_steps(round)
    }

    /// Number of beacons listened for, as a number to reckon with.
    #[expect(clippy::cast_precision_loss, reason = "there are a few")]
    pub(super) fn beacons(&self) -> f64 {
        self.beacons as f64
    }

    /// Goes on to the next beacon, after the last to the next position, or ends the turn after the
    /// last of these. The next action follows at once, so its time begins now, whether the device
    /// takes it or not.
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

    /// Angle at which the antenna stands, if it has come to a standstill.
    fn standing(&self) -> Option<f64> {
        match self.phase {
            Phase::Request { angle, .. }
            | Phase::Await { angle, .. }
            | Phase::Locate { angle, .. } => Some(angle),
            Phase::Idle | Phase::Order | Phase::Turn | Phase::Finish { .. } => None,
        }
    }
}
