use foxhunt_core::EstimatorError;
use foxhunt_filters::{BatchError, ShadowingGridError};
use foxhunt_sensors::ParameterError;

/// Why a transmitter was not located.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LocateError {
    /// Nothing was heard.
    #[error("none of {observations} observations holds a level or a bearing")]
    Nothing {
        /// How many observations there were.
        observations: usize,
    },
    /// The estimator works on levels alone, and there are none.
    #[error("the estimator {estimator} needs received levels, and there are bearings alone")]
    NoLevels {
        /// Which estimator.
        estimator: &'static str,
    },
    /// The estimator works on bearings alone, and there are none.
    #[error("the estimator {estimator} needs bearings, and there are received levels alone")]
    NoBearings {
        /// Which estimator.
        estimator: &'static str,
    },
    /// The bearings are too few, or do not meet.
    #[error(
        "the estimator {estimator} finds no place where the bearings meet; batch and particle \
         hold to the searched area and may do"
    )]
    Bearings {
        /// Which estimator.
        estimator: &'static str,
        /// Why not.
        source: BatchError,
    },
    /// The observations have no most probable place, or it was not found.
    #[error("the estimator batch finds no place: {0}")]
    Batch(BatchError),
    /// The levels make no map.
    #[error("the estimator field-map makes no map of the levels: {0}")]
    Field(BatchError),
    /// The grid cannot use the levels.
    #[error(transparent)]
    Grid(#[from] ShadowingGridError),
    /// A parameter is out of its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The estimator cannot be made.
    #[error("the estimator cannot start: {0}")]
    Start(EstimatorError),
    /// The estimator cannot use an observation.
    #[error("observation {index} (at {time} s) cannot be used")]
    Observation {
        /// Which observation, from 0.
        index: usize,
        /// When it was made, in seconds.
        time: f64,
        /// Why not.
        source: EstimatorError,
    },
}
