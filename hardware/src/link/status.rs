use std::fmt;

use serde::{Deserialize, Serialize};

use super::{ClockOffset, UnixTime};

/// State of a drone, several times a second.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Status {
    /// Time of the status, by the clock of the one that fuses as far as the drone knows it.
    pub at: UnixTime,
    /// Time of the status by the drone's own clock; it comes back in the order's
    /// [`Echo`](super::Echo).
    pub sent: UnixTime,
    /// Offset of the drone's clock; absent while that is not known.
    pub clock: Option<ClockOffset>,
    /// The [`number`](super::Order::number) of the order that it follows; 0 without an order.
    pub order: u64,
    /// Stage of its flight.
    pub stage: Stage,
    /// Reason why it does not follow, or fault since; empty without one.
    pub failure: String,
}

/// Stage of a drone's flight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Stage {
    /// It is on the ground, and not ready.
    Preparing,
    /// It is on the ground, and could take off.
    Ready,
    /// It takes off.
    Climbing,
    /// It is in the air and follows its orders.
    #[default]
    Flying,
    /// It takes no orders: its pilot has it, it flies by its own rules, or its link is lost.
    Away,
    /// It comes down by the pilot's rules.
    Leaving,
    /// It is down, or in its pilot's hands, and takes no part any more.
    Over,
}

impl Stage {
    /// All stages, in the order of a flight.
    pub const ALL: [Self; 7] = [
        Self::Preparing,
        Self::Ready,
        Self::Climbing,
        Self::Flying,
        Self::Away,
        Self::Leaving,
        Self::Over,
    ];
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Preparing => "is not ready",
            Self::Ready => "is ready to take off",
            Self::Climbing => "takes off",
            Self::Flying => "flies",
            Self::Away => "takes no orders",
            Self::Leaving => "leaves",
            Self::Over => "is out of the hunt",
        })
    }
}
