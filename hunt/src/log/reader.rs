use std::{
    fs, io,
    path::{Path, PathBuf},
};

use super::{LOG_VERSION, LogHeader, OLDEST_LOG_VERSION};
use crate::{document, hunt::Event};

/// A log that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    /// Header of the log.
    pub header: LogHeader,
    /// Events of the log, in the order in which they happened.
    pub events: Vec<Event>,
    /// True if the last line was cut short, as by a crash; it is left out of `events`.
    pub torn: bool,
}

impl Log {
    /// Reads a log file.
    ///
    /// # Errors
    ///
    /// [`LogError`] names the file and the line.
    #[inline]
    pub fn read(path: &Path) -> Result<Self, LogError> {
        let failed = |source| LogError::Read { path: path.to_owned(), source };
        let text = match String::from_utf8(fs::read(path).map_err(failed)?) {
            Ok(text) => text,
            // The end was cut within a character; a stand-in for it leaves the line as torn.
            Err(cut) if cut.utf8_error().error_len().is_none() => {
                String::from_utf8_lossy(cut.as_bytes()).into_owned()
            }
            Err(other) => {
                return Err(failed(io::Error::new(io::ErrorKind::InvalidData, other.utf8_error())));
            }
        };
        Self::parse(&text, path)
    }

    /// Reads a log from text; `path` is what errors call it.
    ///
    /// # Errors
    ///
    /// [`LogError`] names the file and the line.
    #[inline]
    pub fn parse(text: &str, path: &Path) -> Result<Self, LogError> {
        let path = || path.to_owned();
        let mut lines = text.lines().enumerate();
        let (_, first) = lines.next().ok_or_else(|| LogError::Empty { path: path() })?;
        let version = document::from_json::<Version>(first)
            .map_err(|source| LogError::NotALog { path: path(), source })?
            .foxhunt_log;
        if !(OLDEST_LOG_VERSION..=LOG_VERSION).contains(&version) {
            return Err(LogError::Version { path: path(), version });
        }
        let broken =
            |line: usize| move |source| LogError::Line { path: path(), line: line + 1, source };
        let header = document::from_json(first).map_err(broken(0))?;
        let mut events = Vec::new();
        let mut torn = false;
        let last = text.lines().count() - 1;
        for (index, line) in lines {
            match document::from_json(line) {
                Ok(event) => events.push(event),
                Err(_) if index == last && !text.ends_with('\n') => torn = true,
                Err(source) => return Err(broken(index)(source)),
            }
        }
        Ok(Self { header, events, torn })
    }
}

/// The one field that every version's header has.
#[derive(serde::Deserialize)]
struct Version {
    foxhunt_log: u32,
}

/// Reason why a log cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// The file cannot be read.
    #[error("{}: cannot be read", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Cause of the failure.
        source: std::io::Error,
    },
    /// The file is empty.
    #[error("{}: the file is empty; a log begins with a header", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The first line is no header.
    #[error("{}, line 1: no header of a foxhunt log", path.display())]
    NotALog {
        /// The file.
        path: PathBuf,
        /// Error of the parser.
        source: serde_json::Error,
    },
    /// The log is of another version.
    #[error(
        "{}, line 1: foxhunt_log is {version}; this program reads {OLDEST_LOG_VERSION} to \
         {LOG_VERSION}",
        path.display()
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// Version of the log.
        version: u32,
    },
    /// A line is no event.
    #[error("{}, line {line}: not an event of a foxhunt log", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
        /// Error of the parser.
        source: serde_json::Error,
    },
}
