use std::path::PathBuf;

use super::format::{ReceptionId, RowId, STRUCK_VERSION};

/// Reason why a list of struck receptions cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StruckError {
    /// The file cannot be read.
    #[error("{}: cannot be read", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the file system.
        source: std::io::Error,
    },
    /// The first line is no header.
    #[error(
        "{}, line 1: no header of struck receptions, such as {{\"foxhunt_struck\":1}}",
        path.display()
    )]
    Header {
        /// The file.
        path: PathBuf,
        /// The JSON error.
        source: serde_json::Error,
    },
    /// The list is of another version.
    #[error(
        "{}, line 1: foxhunt_struck is {version}; this program reads {STRUCK_VERSION}",
        path.display()
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// Version of the list.
        version: u32,
    },
    /// A line is no reception.
    #[error("{}, line {line}: not {what}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// Expected contents of such a line.
        what: &'static str,
        /// The JSON error.
        source: serde_json::Error,
    },
    /// The log has no such reception.
    #[error(
        "{}, line {line}: the log has no reception of {reception}; {}",
        path.display(),
        where_it_is(nearest.as_ref())
    )]
    NoReception {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// The reception in that line.
        reception: ReceptionId,
        /// The reception of the same drone and beacon that is nearest in time.
        nearest: Option<ReceptionId>,
    },
    /// The recordings have no reception in such a row.
    #[error("{}, line {line}: there is no reception of {row}; {there}", path.display())]
    NoRow {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// The row in that line.
        row: RowId,
        /// Text about the rows that exist instead.
        there: String,
    },
    /// A reception stands there twice.
    #[error("{}, line {line}: {what} stands in line {before} already", path.display())]
    Twice {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// The reception in that line.
        what: String,
        /// Number of the earlier line.
        before: usize,
    },
}

fn where_it_is(nearest: Option<&ReceptionId>) -> String {
    nearest.map_or_else(
        || "that drone has none of that beacon".to_owned(),
        |nearest| format!("the nearest is at {}", nearest.time),
    )
}
