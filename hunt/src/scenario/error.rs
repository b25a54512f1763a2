use foxhunt_core::parameter::FieldError;

/// Reason why there is no scenario.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScenarioError {
    /// There is neither a built-in scenario nor a file of this name.
    #[error(
        "{name:?} is neither a file nor a built-in scenario; choose one of {}",
        known.join(", ")
    )]
    Unknown {
        /// The requested name.
        name: String,
        /// The built-in scenarios.
        known: Vec<String>,
    },
    /// The file cannot be read.
    #[error("{file}: cannot be read")]
    Read {
        /// The file.
        file: String,
        /// Cause of the failure.
        source: std::io::Error,
    },
    /// The file is no scenario; the source names line, field and value.
    #[error("{file}: not a scenario")]
    Parse {
        /// The file.
        file: String,
        /// Error of the parser.
        source: toml::de::Error,
    },
    /// A field is out of its range.
    #[error("{file}: {field} is {value}; it must be in {least} … {most}")]
    Field {
        /// The file.
        file: String,
        /// Name of the field.
        field: &'static str,
        /// Value of the field.
        value: f64,
        /// The least it may be.
        least: f64,
        /// The most it may be.
        most: f64,
    },
    /// There are sources for more drones than there are, or for fewer.
    #[error("{file}: sources lists {sources} for {drones} drones; list one for each, or none")]
    Sources {
        /// The file.
        file: String,
        /// Number of sources.
        sources: usize,
        /// Number of drones.
        drones: usize,
    },
    /// The turns cannot be as they are wanted.
    #[error("{file}: turns: {reason}")]
    Turns {
        /// The file.
        file: String,
        /// Description of the error.
        reason: FieldError,
    },
    /// The model cannot be as it is wanted.
    #[error("{file}: model: {reason}")]
    Model {
        /// The file.
        file: String,
        /// Description of the error.
        reason: FieldError,
    },
    /// A beacon that appears later stands before one that appears earlier.
    #[error("{file}: world.beacons must be in the order in which they appear (appears_after_s)")]
    Late {
        /// The file.
        file: String,
    },
}
