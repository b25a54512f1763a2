use foxhunt_hardware::link::LinkError;

use crate::hunt::HuntError;

/// Why a node cannot begin or go on.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NetworkError {
    /// A field of the configuration is out of its range.
    #[error("{field} is {value}; it must be positive and finite")]
    Config {
        /// Which field.
        field: &'static str,
        /// What it held.
        value: f64,
    },
    /// There is nobody to fly.
    #[error("a hunt needs at least one drone")]
    NoDrone,
    /// A clock tells a time that is none.
    #[error("{time} s after the clock began is no time")]
    Time {
        /// What it told.
        time: f64,
    },
    /// The link failed; the node goes on when it is called again.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The hunt itself cannot go on.
    #[error(transparent)]
    Hunt(#[from] HuntError),
}
