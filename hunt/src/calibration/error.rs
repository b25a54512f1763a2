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
        /// Version of the file.
        version: u32,
        /// Version that this program reads.
        known: u32,
    },
    /// A number of an array is out of its range.
    #[error("{file}: array {number} ({name}): {source}")]
    Array {
        /// The file.
        file: String,
        /// Number of the array, from 1.
        number: usize,
        /// Name of the array; empty without one.
        name: String,
        /// Name of the number, and why it is refused.
        source: ParameterError,
    },
    /// Two arrays are of one receiver, so that the second would never count.
    #[error("{file}: array {number} ({name}): an array before it is of its receiver, too")]
    ArrayTwice {
        /// The file.
        file: String,
        /// Number of the second, from 1.
        number: usize,
        /// Name of the array; empty without one.
        name: String,
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
