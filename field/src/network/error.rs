use foxhunt_core::parameter::{FieldError, ParameterError};
use foxhunt_hardware::link::LinkError;
use foxhunt_hunt::hunt::HuntError;

/// Reason why a node cannot begin or go on.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NetworkError {
    /// A field of the configuration is out of its range.
    #[error(transparent)]
    Config(#[from] ParameterError),
    /// A rule of the flight is out of its range.
    #[error(transparent)]
    Rule(#[from] FieldError),
    /// No drone was given.
    #[error("a hunt needs at least one drone")]
    NoDrone,
    /// The reading of a clock cannot be represented as a time.
    #[error("{time} s after the clock began is no time")]
    Time {
        /// Reading of the clock, in seconds.
        time: f64,
    },
    /// The link failed; the node goes on when it is called again.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The hunt itself cannot go on.
    #[error(transparent)]
    Hunt(#[from] HuntError),
}
