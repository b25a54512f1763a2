use super::Refusal;

/// Error of a link that did not carry something.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LinkError {
    /// It could not be set up.
    #[error("{over}: {what} cannot be set up: {reason}")]
    Open {
        /// By what it goes.
        over: &'static str,
        /// The part that could not be set up, such as a topic.
        what: String,
        /// The reason given.
        reason: String,
    },
    /// A message could not be sent, or one that came could not be read.
    #[error("{over}: {what}: {reason}")]
    Message {
        /// By what it goes.
        over: &'static str,
        /// The topic.
        what: String,
        /// The reason given.
        reason: String,
    },
    /// There is no such drone.
    #[error("there is no drone {drone}; there are {drones}, counted from 0")]
    Drone {
        /// Requested drone.
        drone: usize,
        /// Number of drones.
        drones: usize,
    },
    /// Messages were refused. It is reported for the first of them since the link was set up, the
    /// tenth, the hundredth and so on.
    #[error("{from}: {count} refused: {why}")]
    Refused {
        /// The channel that they came on, such as `drone_0/report`.
        from: String,
        /// Reason.
        why: Refusal,
        /// Number of refusals for this reason.
        count: u64,
    },
    /// A number cannot be sent this way.
    #[error("{field} is {value}, which cannot be sent")]
    Value {
        /// Name of the number.
        field: &'static str,
        /// Value of the number.
        value: String,
    },
}
