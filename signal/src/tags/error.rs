use std::{io, path::PathBuf};

/// The reason why pulses cannot be read or associated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TagError {
    /// The file cannot be read.
    #[error("{}: cannot be read", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// The header belongs to no known file.
    #[error("{}, line 1: the columns {columns} are not those of {wanted}", file.display())]
    Header {
        /// The file.
        file: PathBuf,
        /// The columns of the file.
        columns: String,
        /// The columns that are known.
        wanted: &'static str,
    },
    /// A line has another number of fields than the header, or is not text.
    #[error("{}, line {line}: {problem}", file.display())]
    Line {
        /// The file.
        file: PathBuf,
        /// The line, from 1.
        line: u64,
        /// The problem.
        problem: String,
    },
    /// A field does not hold what it must.
    #[error("{}, line {line}, {field}: {value:?} is not {requirement}", file.display())]
    Field {
        /// The file.
        file: PathBuf,
        /// The line, from 1.
        line: u64,
        /// The column.
        field: String,
        /// The content of the field.
        value: String,
        /// The requirement on the field.
        requirement: &'static str,
    },
    /// Two tags of a table have the same name.
    #[error("{}, line {line}: there is a tag {name:?} already", file.display())]
    Twice {
        /// The file.
        file: PathBuf,
        /// The line of the second, from 1.
        line: u64,
        /// The name.
        name: String,
    },
    /// A parameter is out of its range.
    #[error("{name} is {value}; it must be {requirement}")]
    Parameter {
        /// The parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The requirement on the value.
        requirement: &'static str,
    },
    /// A pulse holds a number that is not finite.
    #[error("pulse {index}: {field} is {value}; it must be finite")]
    Pulse {
        /// Its place in the list.
        index: usize,
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
    },
}
