use super::FirmataConfig;

/// A move of the motor in one direction, or its stop, until it is known to have ended.
///
/// The link has no checksum, so that a report is believed within what the order and the motor's
/// speed allow. The message that a move is complete may be lost, and so may the order: the position
/// is queried while the motor turns, and once the move should have ended.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    /// Place of its end, in steps; `None` if it ends wherever the motor stops.
    pub(super) to: Option<i64>,
    /// Greatest length, in steps.
    pub(super) steps: u64,
    /// Beginning; `None` if the motor turned already.
    from: Option<i64>,
    /// Range in which the motor may be.
    lowest: i64,
    highest: i64,
    /// Place of the Arduino's own 0.
    zero: i64,
    began: f64,
    /// Seconds below which it cannot have ended.
    least_s: f64,
    ends_at: f64,
    query_at: f64,
    deadline: f64,
    /// Its last reported position.
    last: Option<i64>,
    /// True if a report was elsewhere than at the Arduino's 0.
    stirred: bool,
    /// End of the move before it, whose message may still come.
    overtaken: Option<i64>,
    /// True if it was reported that it does not end.
    pub(super) is_given_up: bool,
}

/// A reported position in the light of its move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Seen {
    /// It is on its way.
    Going,
    /// It is where it was sent, or stands after a stop.
    Complete,
    /// It stands elsewhere on its way.
    Short,
    /// It is where this move does not lead, or sooner than it can be.
    Astray,
    /// Its count was set to 0, which nobody ordered.
    Zeroed,
    /// The move has ended sooner than the motor turns.
    TooFast,
}

/// Action that is due about a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Due {
    Nothing,
    /// Query its position.
    RequestPosition,
    /// Query its position, and send its speed again: it should have ended.
    Urge,
    /// It has lasted for too long: this number of seconds.
    TimedOut(f64),
}

/// Delay in seconds of the first query after the expected end, and of each further one.
const QUERY_S: f64 = 0.25;
/// Interval of queries while it turns, in seconds: 60 half steps at the default speed.
pub(super) const MONITOR_S: f64 = 0.1;
/// Time in which a stop is carried out, in seconds.
const STOP_S: f64 = 0.3;

impl Leg {
    /// One to `to` that begins now at `from`, or anywhere between two places if the motor turns.
    pub(super) fn new(
        to: i64,
        [lowest, highest]: [i64; 2],
        zero: i64,
        config: &FirmataConfig,
        now: f64,
    ) -> Self {
        let steps = to.abs_diff(lowest).max(to.abs_diff(highest));
        let away = to.abs_diff(to.clamp(lowest, highest));
        let stood = lowest == highest;
        // With a ramp, a motor that turns first goes on.
        let beyond = if stood { 0 } else { config.stopping_steps() };
        let duration = config.duration_s(steps);
        let mut leg = Self {
            to: Some(to),
            steps,
            from: stood.then_some(lowest),
            lowest: lowest.min(to) - beyond,
            highest: highest.max(to) + beyond,
            zero,
            began: now,
            least_s: config.least_s(away, stood),
            ends_at: now + duration,
            query_at: now,
            deadline: now + 2.0 * duration + config.answer_timeout_s,
            last: None,
            stirred: false,
            overtaken: None,
            is_given_up: false,
        };
        leg.query_next(now);
        leg
    }

    /// This one, ordered before another one was known to have ended.
    pub(super) fn overtaking(self, other: &Self) -> Self {
        Self { overtaken: other.to, ..self }
    }

    /// The stop of this move.
    pub(super) fn stopped(&self, config: &FirmataConfig, now: f64) -> Self {
        let [mut lowest, mut highest] = self.range();
        if let Some(from) = self.from {
            let most = config.most_steps(now + STOP_S - self.began);
            (lowest, highest) = (lowest.max(from - most), highest.min(from + most));
        }
        // A move that falls silent is given up when it would have been.
        let deadline = self.deadline.max(now + config.answer_timeout_s);
        let ends_at = now;
        let query_at = now + MONITOR_S;
        Self { to: None, lowest, highest, ends_at, query_at, deadline, last: None, ..*self }
    }

    /// The stop of this move, which was given up.
    pub(super) fn given_up(&self, config: &FirmataConfig, now: f64) -> Self {
        Self { is_given_up: true, ..self.stopped(config, now) }
    }

    /// Returns its age in seconds.
    pub(super) fn lasted(&self, now: f64) -> f64 {
        now - self.began
    }

    /// Returns the range in which the motor may be meanwhile.
    pub(super) fn range(&self) -> [i64; 2] {
        [self.lowest, self.highest]
    }

    /// Returns true if the Arduino's 0 is its end, and its beginning does not show that it went
    /// there: an order that was garbled into a zero would look the same.
    pub(super) fn is_doubtful(&self) -> bool {
        self.to == Some(self.zero)
            && self.from != Some(self.zero)
            && self.from.is_none_or(|from| (from - self.zero) % 8 == 0)
    }

    /// Takes the motor's reported position.
    pub(super) fn see(&mut self, at: i64, done: bool, config: &FirmataConfig, now: f64) -> Seen {
        if done && self.to != Some(at) && self.overtaken.take_if(|to| *to == at).is_some() {
            return Seen::Going;
        }
        let stands = self.last.replace(at) == Some(at);
        let within = (self.lowest..=self.highest).contains(&at);
        let Some(to) = self.to else {
            // A stop is believed when two reports agree.
            return match stands {
                false => {
                    self.query_at = now;
                    Seen::Going
                }
                true if at == self.zero => Seen::Zeroed,
                true if within => Seen::Complete,
                true => Seen::Astray,
            };
        };
        let ahead = self.from.is_some_and(|from| {
            let most = config.most_steps(now - self.began);
            from.abs_diff(at) > most.unsigned_abs()
        });
        if !within {
            return Seen::Astray;
        }
        if !done && !stands {
            self.stirred |= at != self.zero;
            if at == to {
                self.query_at = now;
            }
            return if ahead { Seen::Astray } else { Seen::Going };
        }
        let zeroed = at == self.zero
            && if at == to {
                self.is_doubtful() && !self.stirred
            } else {
                done || self.stirred || self.from != Some(self.zero)
            };
        if zeroed {
            return Seen::Zeroed;
        }
        if at == to && now - self.began < self.least_s || ahead {
            return Seen::TooFast;
        }
        if at == to { Seen::Complete } else { Seen::Short }
    }

    pub(super) fn due(&mut self, now: f64) -> Due {
        if now >= self.deadline {
            return Due::TimedOut(now - self.began);
        }
        if now < self.query_at {
            return Due::Nothing;
        }
        let late = now >= self.ends_at + QUERY_S;
        self.query_next(now);
        if late { Due::Urge } else { Due::RequestPosition }
    }

    fn query_next(&mut self, now: f64) {
        let monitored = now + MONITOR_S;
        let late = self.ends_at + QUERY_S;
        self.query_at = if monitored + MONITOR_S / 2.0 < self.ends_at {
            monitored
        } else if now < late {
            late
        } else if self.to.is_none() {
            monitored
        } else {
            now + QUERY_S
        };
    }
}
