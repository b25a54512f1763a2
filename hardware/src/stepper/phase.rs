use super::leg::Leg;

/// Present activity of the stepper.
#[derive(Clone, Copy, Debug)]
pub(super) enum Phase {
    /// Waiting for the report which firmware there is.
    Greeting(Wait),
    /// Set up; waiting for the report that it stands at its own 0.
    Arranging(Wait),
    /// Waiting for the report where it stands, after the link was broken.
    Checking(Wait),
    /// Making its first step, which shows that its coils follow.
    Aligning(Leg),
    /// Waiting for reports that confirm where it stands.
    Confirming(Confirming),
    Homing(Stage),
    Moving {
        leg: Leg,
        /// Next place, in steps.
        then: Option<i64>,
        /// Side of the gear's play at the end.
        side: Side,
    },
    Standing {
        /// From when on the antenna does not swing.
        settled: f64,
        /// Time at which its position is queried next.
        watch_at: f64,
    },
}

/// Since when something is waited for, which is when it was first queried, and when it was last
/// queried.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wait {
    pub(super) since: f64,
    queried_at: Option<f64>,
    every_s: f64,
    /// Number of queries.
    pub(super) count: u32,
    /// Number of unexpected answers.
    pub(super) doubts: u32,
}

/// Interval of queries in seconds.
const QUERY_S: f64 = 0.5;

impl Wait {
    pub(super) fn new(now: f64) -> Self {
        Self { since: now, queried_at: None, every_s: QUERY_S, count: 0, doubts: 0 }
    }

    /// One that queries at other intervals, in seconds.
    pub(super) fn every(self, every_s: f64) -> Self {
        Self { every_s, ..self }
    }

    /// Returns true if a query is due, and counts it as sent.
    pub(super) fn is_due(&mut self, now: f64) -> bool {
        let due = self.queried_at.is_none_or(|queried_at| now >= queried_at + self.every_s - 1e-9);
        if due {
            if self.queried_at.is_none() {
                self.since = now;
            }
            self.queried_at = Some(now);
            self.count += 1;
        }
        due
    }
}

/// Reports that are to confirm where the motor stands.
#[derive(Clone, Copy, Debug)]
pub(super) struct Confirming {
    /// Place to confirm, in steps.
    pub(super) at: i64,
    pub(super) next: Next,
    pub(super) since: f64,
    /// Time of the last request.
    pub(super) asked_at: f64,
    /// True if the levels of the coils are still to come.
    pub(super) reads: bool,
    /// True if the position is still to come.
    pub(super) asks: bool,
    /// Reports that contradicted.
    pub(super) strikes: u8,
}

/// Step that follows on a confirmed place.
#[derive(Clone, Copy, Debug)]
pub(super) enum Next {
    /// The first step.
    Align,
    /// A place to stand at, and where the play of the gear is.
    Stand(Side),
}

/// Side on which the play of the gear is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Unknown,
    /// The antenna was pushed forwards: it is where the motor is.
    Below,
    /// The antenna was pulled backwards: it is ahead of the motor by the play.
    Above,
}

/// Stage of the search for the home switch.
#[derive(Clone, Copy, Debug)]
pub(super) enum Stage {
    /// Waiting for two reports whether the switch is closed.
    Level {
        wait: Wait,
        seen: Option<bool>,
        /// Remaining distance of the search, in steps.
        left: i64,
    },
    /// Turning backwards until it closes.
    Seeking(Leg),
    /// Stopping there; where it would have been given up.
    Stopping(Leg, i64),
    /// Going forwards by a step; how many there were.
    Leaving(Leg, u64),
    /// Waiting for the switch, until then; how many steps there were.
    Looking { until: f64, steps: u64, wait: Wait, opened: bool },
}
