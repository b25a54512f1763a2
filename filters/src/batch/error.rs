use foxhunt_core::parameter::{ParameterError, finite, positive};

/// Reason that observations were not turned into an estimate.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BatchError {
    /// There is too little to go by.
    #[error("there are {have} {what}, and {need} are needed")]
    TooFew {
        /// Name of the entries, in the plural.
        what: &'static str,
        /// Number present.
        have: usize,
        /// Number needed.
        need: usize,
    },
    /// A number that came in is NaN, infinite or, where it must be, not positive.
    #[error("entry {index}: {error}")]
    Value {
        /// Index of the entry in its list, from 0.
        index: usize,
        /// The number, and what it must be.
        error: ParameterError,
    },
    /// Times do not ascend.
    #[error("time {index}: {seconds} s after the one before; it must be later")]
    Order {
        /// Index of the time, from 0.
        index: usize,
        /// Time since the one before, in seconds.
        seconds: f64,
    },
    /// A setting is out of its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The model or its Jacobian is not finite at a start, or the prior has no factor.
    #[error("the {what} is not finite or not positive definite")]
    Improper {
        /// Name of the part.
        what: &'static str,
    },
    /// The likelihood is flat: the observations leave a direction of the state undetermined.
    #[error("the likelihood is flat: the reciprocal condition of the information is {rcond:e}")]
    Flat {
        /// The least over the largest eigenvalue of the information, each component in its own
        /// unit; 0 where it has none.
        rcond: f64,
    },
    /// The iterates ran out of every bounded region: the likelihood grows towards infinity.
    #[error("the estimate ran away to {distance_m:e} m, beyond {limit_m:e} m")]
    RanAway {
        /// Distance from the middle of the receivers, in metres.
        distance_m: f64,
        /// Largest distance allowed, in metres.
        limit_m: f64,
    },
    /// The iteration did not settle.
    #[error("{iterations} iterations did not settle")]
    NotConverged {
        /// Number of iterations.
        iterations: u32,
    },
    /// The iteration settled where the directions contradict the place: no maximum.
    #[error("the bearings contradict the place that they meet in: mean cosine {mean_cosine}")]
    Contradiction {
        /// The mean cosine of the bearings' errors.
        mean_cosine: f64,
    },
}

/// Refuses an entry's number that is not finite.
pub(crate) fn finite_entry(
    name: &'static str,
    index: usize,
    value: f64,
) -> Result<f64, BatchError> {
    finite(name, value).map_err(|error| BatchError::Value { index, error })
}

/// Refuses an entry's number that is not positive and finite.
pub(crate) fn positive_entry(
    name: &'static str,
    index: usize,
    value: f64,
) -> Result<f64, BatchError> {
    positive(name, value).map_err(|error| BatchError::Value { index, error })
}

/// Refuses fewer entries than it takes.
pub(crate) fn at_least(what: &'static str, have: usize, need: usize) -> Result<(), BatchError> {
    if have < need { Err(BatchError::TooFew { what, have, need }) } else { Ok(()) }
}
