use foxhunt_core::{EstimatorError, parameter::ParameterError};
use foxhunt_hunt::registry::RegistryError;

use crate::ThreadsError;

/// The reason why there is no trial.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrialError {
    /// There is no such file and no such trial.
    #[error("{file}: cannot be read")]
    Read {
        /// The file.
        file: String,
        /// The cause.
        source: std::io::Error,
    },
    /// The file is no trial; the source names line, field and value.
    #[error("{file}: not a trial")]
    Parse {
        /// The file.
        file: String,
        /// The cause.
        source: toml::de::Error,
    },
    /// A field is out of its range.
    #[error("{trial}: {error}")]
    Field {
        /// The trial.
        trial: String,
        /// The field, its value and what it must be.
        error: ParameterError,
    },
    /// The estimator does not run in this trial.
    #[error("{estimator} cannot run in {trial}: it needs {needs}")]
    Unsuited {
        /// Its name.
        estimator: String,
        /// The trial.
        trial: String,
        /// The requirement of the estimator.
        needs: &'static str,
    },
    /// The density of the bearings is out of range.
    #[error("the bearings of the trial: {0}")]
    Bearings(#[from] ParameterError),
    /// The estimator cannot be built.
    #[error("the estimator of the trial: {0}")]
    Estimator(#[from] EstimatorError),
    /// The estimator takes all receptions at once.
    #[error(transparent)]
    Name(#[from] RegistryError),
    /// The threads could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
}
