/// A move of the motor in one direction, or its stop, until it is known to have ended.
///
/// The message that it is complete may be lost, and so may the order: once it should have come, the
/// motor's position is queried, and it is ordered again if it does not move.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    /// Where it ends, in steps; `None` where it ends wherever the motor stops.
    pub(super) to: Option<i64>,
    /// How far that is, at most.
    pub(super) steps: u64,
    began: f64,
    query_at: f64,
    deadline: f64,
    /// Its last reported position.
    last: Option<i64>,
    repeat: bool,
}

/// What has to be done about a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Due {
    Nothing,
    /// Query its position.
    RequestPosition,
    /// Order it once more, and query.
    Repeat,
    /// It has taken so many seconds, and too long.
    TimedOut(f64),
}

/// How long after it should have ended the motor is queried, and how often then, in seconds.
const QUERY_S: f64 = 0.25;

impl Leg {
    /// One that begins now and should take `duration` seconds; `patience` is for the link.
    pub(super) fn new(to: Option<i64>, steps: u64, duration: f64, patience: f64, now: f64) -> Self {
        let (query_at, deadline) = (now + duration + QUERY_S, now + 2.0 * duration + patience);
        Self { to, steps, began: now, query_at, deadline, last: None, repeat: false }
    }

    /// Takes the motor's reported position; whether the move is complete.
    pub(super) fn is_complete(&mut self, at: i64, done: bool) -> bool {
        let stands = self.last.replace(at) == Some(at);
        let there = self.to.is_none_or(|to| to == at);
        if there && (done || stands) {
            return true;
        }
        // What ended elsewhere was another order's, or was cut short.
        self.repeat |= done || stands;
        false
    }

    pub(super) fn due(&mut self, now: f64) -> Due {
        if now >= self.deadline {
            return Due::TimedOut(now - self.began);
        }
        if std::mem::take(&mut self.repeat) {
            self.query_at = now + QUERY_S;
            self.last = None;
            return Due::Repeat;
        }
        if now >= self.query_at {
            self.query_at = now + QUERY_S;
            return Due::RequestPosition;
        }
        Due::Nothing
    }
}
