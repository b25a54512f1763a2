use std::io;

/// The reason why samples cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SampleError {
    /// A file that cannot be opened.
    #[error("{file}: cannot be opened")]
    Open {
        /// The file.
        file: String,
        /// The cause.
        source: io::Error,
    },
    /// A file or stream that cannot be read any further.
    #[error("{file}: cannot be read after {samples} samples")]
    Read {
        /// The file.
        file: String,
        /// The number of samples that came before.
        samples: u64,
        /// The cause.
        source: io::Error,
    },
    /// A value that cannot be used.
    #[error("{file}: {field} is {value}, and must be {requirement}")]
    Field {
        /// The file.
        file: String,
        /// The name of the value.
        field: String,
        /// The value.
        value: String,
        /// The requirement on the value.
        requirement: String,
    },
}

impl SampleError {
    pub(super) fn field(
        file: &str,
        field: impl Into<String>,
        value: impl ToString,
        requirement: impl Into<String>,
    ) -> Self {
        Self::Field {
            file: file.to_owned(),
            field: field.into(),
            value: value.to_string(),
            requirement: requirement.into(),
        }
    }
}
