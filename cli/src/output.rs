//! Outputs of a command: results, warnings, and files that are checked before the work begins.

use std::{
    cell::RefCell,
    collections::BTreeMap,
    fs::{self, OpenOptions},
    io::{self, Write},
    path::Path,
};

use clap::ValueEnum;
use foxhunt::{document, registry::Registry};
use serde::Serialize;

use crate::{error::CliError, screen};

/// Inputs of every command besides its own arguments.
#[derive(Clone, Copy, Debug)]
pub struct Context<'a> {
    /// Output for results and notes.
    pub output: Output<'a>,
    /// The estimators, extractors, planners and sources, by name.
    pub registry: &'a Registry,
    /// All commands, their arguments with the names of a registry.
    pub command_line: fn(&Registry) -> clap::Command,
}

/// Form of results for other programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum JsonForm {
    /// The result as one value.
    Value,
    /// A value per line: the events of long work, then the result.
    Lines,
}

/// Destination of results and notes.
///
/// With `--json` standard output holds one JSON value and nothing else, with `--json=lines` one in
/// each line; without it, tables and notes. Progress is on standard error either way.
#[derive(Clone, Copy, Debug)]
pub struct Output<'a> {
    json: Option<JsonForm>,
    /// Buffer that takes the result in place of standard output.
    kept: Option<&'a RefCell<String>>,
}

/// A line of JSON: a kind and a value.
#[derive(Serialize)]
struct Line<'a, T> {
    kind: &'a str,
    value: &'a T,
}

impl<'a> Output<'a> {
    pub fn new(json: Option<JsonForm>) -> Self {
        Self { json, kept: None }
    }

    /// Returns true if the result is one value of JSON.
    pub fn is_json(self) -> bool {
        self.json.is_some()
    }

    /// Returns true if this program is part of another one, which takes the result.
    pub fn is_kept(self) -> bool {
        self.kept.is_some()
    }

    /// Keeps the result as JSON, where nothing is printed on standard output.
    pub fn kept_in(json: &'a RefCell<String>) -> Self {
        Self { json: Some(JsonForm::Value), kept: Some(json) }
    }

    /// Returns true if [`event`] prints the events of long work on standard output.
    pub fn streams(self) -> bool {
        self.json == Some(JsonForm::Lines)
    }

    /// Prints the result as JSON, or as the text that `text` makes of it.
    pub fn result<T: Serialize>(
        self,
        value: &T,
        text: impl FnOnce(&T) -> String,
    ) -> Result<(), CliError> {
        let text = match self.json {
            // A text of millions of rows is not held.
            Some(JsonForm::Value) if self.kept.is_none() => {
                return json_to_stdout(value).map_err(CliError::printing);
            }
            Some(JsonForm::Value) => document::to_pretty_json(value).map_err(CliError::failure)?,
            Some(JsonForm::Lines) => return event("result", value).map_err(CliError::printing),
            None => screen::wrapped(text(value).trim_end(), screen::width()),
        };
        match self.kept {
            Some(kept) => {
                kept.replace(text);
                Ok(())
            }
            None => to_stdout(&text),
        }
    }

    /// Prints a text as it is, or as JSON.
    pub fn verbatim(self, text: &str) -> Result<(), CliError> {
        match self.json {
            Some(_) => self.result(&text, |text| (*text).to_owned()),
            None => to_stdout(text.trim_end()),
        }
    }

    /// Prints a line beside the result, unless the result is kept.
    pub fn note(self, line: &str) -> Result<(), CliError> {
        if self.kept.is_some() {
            return Ok(());
        }
        if self.json.is_some() {
            warn(line);
            Ok(())
        } else {
            to_stdout(line)
        }
    }
}

thread_local! {
    /// The warnings of the command that runs, each with how often it came.
    static WARNED: RefCell<BTreeMap<String, u32>> = const { RefCell::new(BTreeMap::new()) };
    /// Lines of this thread that are kept instead of printed, while a work is [`overheard`].
    static OVERHEARD: RefCell<Option<Vec<String>>> = const { RefCell::new(None) };
}

/// Runs a work; returns its result and the lines that this thread would have printed on standard
/// error.
pub fn overheard<T>(work: impl FnOnce() -> T) -> (T, Vec<String>) {
    let before = OVERHEARD.replace(Some(Vec::new()));
    let done = work();
    (done, OVERHEARD.replace(before).unwrap_or_default())
}

/// Prints a line on standard error the first time that it comes in a command.
pub fn warn_once(line: &str) {
    if OVERHEARD.with_borrow(Option::is_some) {
        warn(line);
        return;
    }
    let is_new = WARNED.with_borrow_mut(|warned| {
        let count = warned.entry(line.to_owned()).or_default();
        *count += 1;
        *count == 1
    });
    if is_new {
        warn(line);
    }
}

/// Prints the counts of repeated warnings at the end of a command, and clears them.
pub fn count_warnings() {
    for (line, count) in WARNED.take() {
        if count > 1 {
            warn(&format!("{count} times: {}", line.trim_start()));
        }
    }
}

/// Prints an event of long work as a line of JSON.
pub fn event<T: Serialize>(kind: &str, value: &T) -> io::Result<()> {
    printed(&document::to_json(&Line { kind, value })?)
}

/// Prints a line on standard error.
pub fn warn(line: &str) {
    let is_kept = OVERHEARD.with_borrow_mut(|kept| match kept {
        Some(kept) => {
            kept.push(line.to_owned());
            true
        }
        None => false,
    });
    if is_kept {
        return;
    }
    // Where standard error is closed nobody can read it.
    let _ = writeln!(io::stderr(), "{line}");
}

fn json_to_stdout<T: Serialize>(value: &T) -> io::Result<()> {
    let mut out = io::BufWriter::new(io::stdout().lock());
    document::write_pretty_json(&mut out, &value)?;
    writeln!(out).and_then(|()| out.flush())
}

fn to_stdout(text: &str) -> Result<(), CliError> {
    printed(text).map_err(CliError::printing)
}

fn printed(text: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "{text}").and_then(|()| out.flush())
}

/// Refuses a file that cannot be written, for want of its folder or of the right. An existing file
/// keeps its contents, and a missing one is not created.
pub fn check_writable(path: &Path) -> Result<(), CliError> {
    check(path).map_err(|error| CliError::writing(path, error))
}

fn check(path: &Path) -> io::Result<()> {
    match OpenOptions::new().write(true).create_new(true).open(path) {
        Ok(_) => fs::remove_file(path),
        // Pipes are opened when they are written: whoever reads them would meet their end here.
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => match path.is_file() {
            true => OpenOptions::new().write(true).open(path).map(drop),
            false if path.is_dir() => Err(io::ErrorKind::IsADirectory.into()),
            false => Ok(()),
        },
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_stay_as_they_are() {
        let folder = std::env::temp_dir().join(format!("foxhunt-writable-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        let old = folder.join("old");
        let new = folder.join("new");
        fs::write(&old, "kept").expect("a file");
        assert!(check_writable(&old).is_ok() && check_writable(&new).is_ok());
        assert_eq!(fs::read_to_string(&old).expect("it is there"), "kept");
        assert!(!new.exists());
        for nowhere in [folder.clone(), folder.join("no/such"), old.join("within")] {
            let error = check_writable(&nowhere).expect_err("it cannot be a file");
            let CliError::Failure(error) = error else { panic!("{error}") };
            assert!(error.to_string().contains("cannot be written"), "{error}");
        }
        fs::remove_dir_all(&folder).expect("it was ours");
    }
}
