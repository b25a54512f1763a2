/// A move of the motor in one direction, or its stop, until it is known to have ended.
///
/// The message that it is complete may be lost, and so may the order: once it should have come, the
/// motor is asked where it is, and ordered again if it does not move.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    /// Where it ends, in steps; `None` where it ends wherever the motor stops.
    pub(super) to: Option<i64>,
    /// How far that is, at most.
    pub(super) steps: u64,
    began: f64,
    ask_at: f64,
    deadline: f64,
    /// Where it was when it was asked last.
    last: Option<i64>,
    repeat: bool,
}

/// What has to be done about a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Due {
    Nothing,
    /// Ask where it is.
    Ask,
    /// Order it once more, and ask.
    Repeat,
    /// It has taken so many seconds, and too long.
    TimedOut(f64),
}

/// How long after it should have ended the motor is asked, and how often then, in seconds.
const ASK_S: f64 = 0.25;

impl Leg {
    /// One that begins now and should take `duration` seconds; `patience` is for the link.
    pub(super) fn new(to: Option<i64>, steps: u64, duration: f64, patience: f64, now: f64) -> Self {
        let (ask_at, deadline) = (now + duration + ASK_S, now + 2.0 * duration + patience);
        Self { to, steps, began: now, ask_at, deadline, last: None, repeat: false }
    }

    /// Takes where the motor says that it is; whether the move is complete.
    pub(super) fn heard(&mut self, at: i64, done: bool) -> bool {
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
            self.ask_at = now + ASK_S;
            self.last = None;
            return Due::Repeat;
        }
        if now >= self.ask_at {
            self.ask_at = now + ASK_S;
            return Due::Ask;
        }
        Due::Nothing
    }
}
