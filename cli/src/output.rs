use std::{
    cell::RefCell,
    io::{self, Write},
    path::Path,
};

use serde::Serialize;

use crate::error::CliError;

/// Where results and notes are printed.
///
/// With `--json` standard output holds one JSON value and nothing else; without it, tables and
/// notes. Progress is on standard error either way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Output<'a> {
    json: bool,
    /// What takes the result in place of standard output.
    kept: Option<&'a RefCell<String>>,
}

impl<'a> Output<'a> {
    pub(crate) fn new(json: bool) -> Self {
        Self { json, kept: None }
    }

    /// Whether the result is one value of JSON.
    pub(crate) fn is_json(self) -> bool {
        self.json
    }

    /// Whether this program is part of another one, which takes the result.
    pub(crate) fn is_kept(self) -> bool {
        self.kept.is_some()
    }

    /// Keeps the result as JSON, where nothing is printed on standard output.
    pub(crate) fn kept_in(json: &'a RefCell<String>) -> Self {
        Self { json: true, kept: Some(json) }
    }

    /// Prints the result: as JSON, or as `text` makes it for people.
    pub(crate) fn result<T: Serialize>(
        self,
        value: &T,
        text: impl FnOnce(&T) -> String,
    ) -> Result<(), CliError> {
        let text = if self.json {
            serde_json::to_string_pretty(value).map_err(CliError::failure)?
        } else {
            text(value).trim_end().to_owned()
        };
        match self.kept {
            Some(kept) => {
                kept.replace(text);
                Ok(())
            }
            None => to_stdout(&text),
        }
    }

    /// Prints a line beside the result, unless the result is kept.
    pub(crate) fn note(self, line: &str) -> Result<(), CliError> {
        if self.kept.is_some() {
            return Ok(());
        }
        if self.json {
            warn(line);
            Ok(())
        } else {
            to_stdout(line)
        }
    }
}

/// Prints a line on standard error.
pub(crate) fn warn(line: &str) {
    // Where standard error is closed nobody can read it.
    let _ = writeln!(io::stderr(), "{line}");
}

fn to_stdout(text: &str) -> Result<(), CliError> {
    let mut out = io::stdout().lock();
    writeln!(out, "{text}").and_then(|()| out.flush()).map_err(|error| match error.kind() {
        // A reader such as `head` that stops early is no failure.
        io::ErrorKind::BrokenPipe => CliError::Closed,
        _ => CliError::writing(Path::new("standard output"), error),
    })
}
