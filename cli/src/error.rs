use std::{
    convert::Infallible,
    error::Error,
    fmt::Write as _,
    io::{self, Write as _},
    path::Path,
    process::ExitCode,
};

/// Reason why a command gave no result.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CommandError {
    /// Wrong use or input, or requested help.
    #[error("{0}")]
    Input(String),
    /// A failure.
    #[error("{0}")]
    Failure(String),
}

/// Error that ends the program.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// Wrong use or input: exit code 2.
    #[error(transparent)]
    Input(Box<dyn Error>),
    /// A failure: exit code 1.
    #[error(transparent)]
    Failure(Box<dyn Error>),
    /// Standard output is closed.
    #[error("standard output is closed")]
    Closed,
}

impl CliError {
    pub fn input(error: impl Into<Box<dyn Error>>) -> Self {
        Self::Input(error.into())
    }

    pub fn failure(error: impl Into<Box<dyn Error>>) -> Self {
        Self::Failure(error.into())
    }

    /// A file that cannot be written.
    pub fn writing(path: &Path, source: io::Error) -> Self {
        Self::failure(WriteError { path: path.display().to_string(), source })
    }

    /// A result that cannot be printed.
    pub fn printing(error: io::Error) -> Self {
        match error.kind() {
            // A reader such as `head` that stops early is no failure.
            io::ErrorKind::BrokenPipe => Self::Closed,
            _ => Self::writing(Path::new("standard output"), error),
        }
    }

    /// Prints the error with all its sources, and returns the exit code.
    pub fn report(&self) -> ExitCode {
        let (code, error) = match self {
            Self::Closed => return ExitCode::SUCCESS,
            Self::Input(error) => (2, error),
            Self::Failure(error) => (1, error),
        };
        // Where standard error is closed nobody can read it.
        let _ = writeln!(io::stderr(), "error: {}", chain(error.as_ref()));
        ExitCode::from(code)
    }
}

impl From<CliError> for CommandError {
    fn from(error: CliError) -> Self {
        match error {
            CliError::Input(error) => Self::Input(chain(error.as_ref())),
            CliError::Failure(error) => Self::Failure(chain(error.as_ref())),
            CliError::Closed => Self::Failure(error.to_string()),
        }
    }
}

impl From<Infallible> for CliError {
    fn from(never: Infallible) -> Self {
        match never {}
    }
}

/// An error and all its sources: "a: b: c". A source whose text an error already holds is
/// left out.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(error) = source {
        let more = error.to_string();
        if !text.contains(more.trim_end()) {
            let _ = write!(text, ": {more}");
        }
        source = error.source();
    }
    text.trim_end().to_owned()
}

/// A file that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{path}: cannot be written")]
struct WriteError {
    path: String,
    source: io::Error,
}

/// An error in a file.
#[derive(Debug, thiserror::Error)]
#[error("{file}")]
pub struct InFile {
    pub file: String,
    pub source: Box<dyn Error>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("outer: {0}")]
    struct Outer(#[source] Inner);

    #[derive(Debug, thiserror::Error)]
    #[error("{0}; use 4")]
    struct Advice(#[source] Inner);

    #[derive(Debug, thiserror::Error)]
    #[error("inner value is 3")]
    struct Inner;

    #[test]
    fn every_source_is_printed_once() {
        assert_eq!(chain(&Outer(Inner)), "outer: inner value is 3");
        assert_eq!(chain(&Advice(Inner)), "inner value is 3; use 4");
        let file = InFile { file: "a.toml".to_owned(), source: Box::new(Outer(Inner)) };
        assert_eq!(chain(&file), "a.toml: outer: inner value is 3");
    }
}
