use nalgebra::Vector3;

use super::drift::{Drift, OtherTargets};

/// Stage of the order that an aircraft was given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Phase {
    /// Nothing yet, or it is down again.
    Idle,
    /// On its way up to `up` metres; at this stage since then.
    TakingOff { up: f64, stage: Stage, since: f64 },
    /// In the mode of our orders, going where it is sent.
    Flying,
    /// It is requested to take the mode of our orders again.
    TakingOver,
    /// Landing where it is.
    Landing,
    /// Coming back by its own rules.
    Returning,
}

/// The farthest that was ordered of a take-off since it stood on the ground, its motors at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Ordered {
    #[default]
    Nothing,
    /// Its motors were to run.
    Arm,
    /// It was to climb, and may do so.
    Climb,
}

/// The stages of a take-off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// Until the position is good.
    Position,
    /// Until it is in the mode in which it is armed.
    Mode,
    /// Until its motors run.
    Arm,
    /// Until it is up.
    Climb,
    /// Until it is in the mode of our orders: PX4 alone climbs in another one.
    Command,
}

/// Its ordered place and heading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Goal {
    /// In metres of the common frame.
    pub(super) place: Vector3<f64>,
    pub(super) nose: Nose,
    /// True if the autopilot has shown that it knows the goal.
    pub(super) confirmed: bool,
    /// Times at which it was sent first, and last.
    pub(super) first: f64,
    pub(super) sent: f64,
    /// Number of times that it was sent.
    pub(super) times: u32,
    /// The autopilot's own target before it was sent.
    pub(super) before: Option<Vector3<f64>>,
    /// Reports of other targets of the autopilot, which knew it or could.
    pub(super) others: OtherTargets,
    /// Watch over its way there.
    pub(super) drift: Drift,
}

/// Order to the nose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Nose {
    /// Points there, in radians counter-clockwise from East.
    Holds(f64),
    /// Turns at this rate in radians per second, counter-clockwise.
    Turns(f64),
}

impl Goal {
    pub(super) fn new(place: Vector3<f64>, nose: Nose) -> Self {
        Self {
            place,
            nose,
            confirmed: false,
            first: f64::NEG_INFINITY,
            sent: f64::NEG_INFINITY,
            times: 0,
            before: None,
            others: OtherTargets::default(),
            drift: Drift::default(),
        }
    }

    /// Returns true if it was never sent in this form.
    pub(super) fn is_new(&self) -> bool {
        self.times == 0
    }
}
