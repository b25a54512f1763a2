use super::leg::Leg;

/// What the stepper is doing.
#[derive(Clone, Copy, Debug)]
pub(super) enum Phase {
    /// Waiting for the report which firmware there is.
    Greeting(Wait),
    /// Set up; waiting for the report which position its own 0 belongs to.
    Arranging {
        wait: Wait,
        /// What was sent, to be sent again.
        how: Arrangement,
    },
    /// Waiting for the report where it is, after the link was broken or a move took too long.
    Checking {
        wait: Wait,
        /// Whether it may have been turning.
        turning: bool,
    },
    Homing(Stage),
    Moving {
        leg: Leg,
        /// Where it goes next, in steps.
        then: Option<i64>,
        /// Where the play of the gear is at the end.
        side: Side,
    },
    Standing {
        /// From when on the antenna does not swing.
        settled: f64,
    },
}

/// Since when something is waited for, which is when it was first queried, and when it was last
/// queried.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wait {
    pub(super) since: f64,
    queried_at: Option<f64>,
}

/// How often something is queried, in seconds.
const QUERY_S: f64 = 0.5;

impl Wait {
    pub(super) fn new(now: f64) -> Self {
        Self { since: now, queried_at: None }
    }

    /// Whether a query is due, which is taken to be sent.
    pub(super) fn is_due(&mut self, now: f64) -> bool {
        let due = self.queried_at.is_none_or(|queried_at| now >= queried_at + QUERY_S);
        if due {
            if self.queried_at.is_none() {
                self.since = now;
            }
            self.queried_at = Some(now);
        }
        due
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Arrangement {
    /// Its pins and speed.
    Setup,
    /// That it is at 0.
    Zero,
}

/// Where the play of the gear is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Unknown,
    /// The antenna was pushed forwards: it is where the motor is.
    Below,
    /// The antenna was pulled backwards: it is ahead of the motor by the play.
    Above,
}

/// How far the search for the home switch is.
#[derive(Clone, Copy, Debug)]
pub(super) enum Stage {
    /// Waiting for the report whether the switch is closed.
    Level(Wait),
    /// Turning backwards until it closes.
    Seeking(Leg),
    /// Stopping there.
    Stopping(Leg),
    /// Going forwards by a step; how many there were.
    Leaving(Leg, u64),
    /// Waiting for the switch, until then; how many steps there were.
    Looking(f64, u64),
}
