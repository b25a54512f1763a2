use super::Refusal;

/// Why a link did not carry something.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LinkError {
    /// It could not be set up.
    #[error("{over}: {what} cannot be set up: {reason}")]
    Open {
        /// By what it goes.
        over: &'static str,
        /// What could not, such as a topic.
        what: String,
        /// The reason given.
        reason: String,
    },
    /// A message could not be sent, or one that came could not be read.
    #[error("{over}: {what}: {reason}")]
    Message {
        /// By what it goes.
        over: &'static str,
        /// Which topic.
        what: String,
        /// The reason given.
        reason: String,
    },
    /// There is no such drone.
    #[error("there is no drone {drone}; there are {drones}, counted from 0")]
    Drone {
        /// Which one was requested.
        drone: usize,
        /// How many there are.
        drones: usize,
    },
    /// Messages were refused, so many since the link was set up. It is reported for the first of
    /// them, the tenth, the hundredth and so on.
    #[error("{from}: {count} refused: {why}")]
    Refused {
        /// The channel that they came on, such as `drone_0/report`.
        from: String,
        /// Why.
        why: Refusal,
        /// How many for this reason.
        count: u64,
    },
    /// A number cannot be sent this way.
    #[error("{field} is {value}, which cannot be sent")]
    Value {
        /// Which number.
        field: &'static str,
        /// What it is.
        value: String,
    },
}
