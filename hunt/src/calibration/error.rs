use foxhunt_sensors::ParameterError;

/// Reason why a file is no calibration.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationFileError {
    /// The file cannot be read.
    #[error("{file}: cannot be read: {source}")]
    Read {
        /// The file.
        file: String,
        /// Cause of the failure.
        source: std::io::Error,
    },
    /// The file is no calibration; the source names line, field and value.
    #[error("{file}: not a calibration: {source}")]
    Parse {
        /// The file.
        file: String,
        /// Error of the parser.
        source: toml::de::Error,
    },
    /// The file is of another version.
    #[error("{file}: foxhunt_calibration is {version}; this program reads {known}")]
    Version {
        /// The file.
        file: String,
        /// Its version.
        version: u32,
        /// The one that is read.
        known: u32,
    },
    /// A number is out of its range.
    #[error("{file}: {section}: {source}")]
    Parameter {
        /// The file.
        file: String,
        /// Name of the section.
        section: &'static str,
        /// Name of the number, and why it is refused.
        source: ParameterError,
    },
}
