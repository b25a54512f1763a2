use std::string::String;

use super::{PatternFileError, PatternTableError};
use foxhunt_core::parameter::ParameterError;

/// Reason that there is no antenna.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AntennaError {
    /// A parameter is out of its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The rows of a table make no pattern.
    #[error(transparent)]
    Table(#[from] PatternTableError),
    /// A file cannot be read.
    #[error("{file}: {reason}")]
    Read {
        /// The file.
        file: String,
        /// The system's error.
        reason: String,
    },
    /// A file holds no antenna.
    #[error("{file}, {source}")]
    File {
        /// The file.
        file: String,
        /// The line and its fault.
        source: PatternFileError,
    },
    /// A file's extension belongs to no known format.
    #[error("{file} has the extension {extension:?}; antennas are read from msi, pln and csv")]
    Extension {
        /// The file.
        file: String,
        /// Its extension, in small letters.
        extension: String,
    },
}
