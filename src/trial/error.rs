use foxhunt_core::{EstimatorError, ObservationError};
use foxhunt_sensors::ParameterError;

/// Why there is no trial.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrialError {
    /// There is no such file and no such trial.
    #[error("{file}: cannot be read")]
    Read {
        /// The file.
        file: String,
        /// Why not.
        source: std::io::Error,
    },
    /// The file is no trial; the source names line, field and value.
    #[error("{file}: not a trial")]
    Parse {
        /// The file.
        file: String,
        /// What is wrong.
        source: toml::de::Error,
    },
    /// A field is out of its range.
    #[error("{trial}: {field} is {value}; it must be {requirement}")]
    Field {
        /// The trial.
        trial: String,
        /// Which field.
        field: &'static str,
        /// What it held.
        value: f64,
        /// What it must be.
        requirement: &'static str,
    },
    /// The estimator does not run in this trial.
    #[error("{estimator} cannot run in {trial}: it needs {needs}")]
    Unsuited {
        /// Its name.
        estimator: String,
        /// The trial.
        trial: String,
        /// What it needs.
        needs: &'static str,
    },
    /// The density of the bearings is out of range.
    #[error("the bearings of the trial: {0}")]
    Bearings(#[from] ParameterError),
    /// A bearing that was drawn is none.
    #[error(transparent)]
    Observation(#[from] ObservationError),
    /// The estimator cannot be built.
    #[error("the estimator of the trial: {0}")]
    Estimator(#[from] EstimatorError),
    /// The threads could not be started.
    #[error("{jobs} threads cannot be started: {reason}")]
    Threads {
        /// How many.
        jobs: usize,
        /// Why not.
        reason: String,
    },
}
