use foxhunt_core::EstimatorError;
use foxhunt_filters::ShadowingGridError;
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
    /// The grid works on levels alone, and there are none.
    #[error("the estimator shadowing-grid needs received levels, and there are bearings alone")]
    NoLevels,
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
    #[error("observation {index} (at {time} s): {source}")]
    Observation {
        /// Which observation, from 0.
        index: usize,
        /// When it was made, in seconds.
        time: f64,
        /// Why not.
        source: EstimatorError,
    },
}
