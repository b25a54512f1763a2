use std::{
    fs::{self, File, OpenOptions},
    io,
    path::{Path, PathBuf},
};

use foxhunt::{
    hunt::Event,
    log::{Log, LogHeader, LogWriter},
};

use crate::error::CliError;

/// The log that a fusion node writes, and goes on from.
pub(super) struct NodeLog {
    path: PathBuf,
    writer: Option<LogWriter<File>>,
    pub(super) header: LogHeader,
    pub(super) events: Vec<Event>,
}

impl NodeLog {
    /// A log that begins with its first event.
    pub(super) fn new(path: &Path, header: LogHeader) -> Self {
        Self { path: path.to_owned(), writer: None, header, events: Vec::new() }
    }

    /// Reads the log, if it exists; without `resume` it must not exist.
    pub(super) fn read(path: &Path, resume: bool) -> Result<Option<Log>, CliError> {
        match fs::metadata(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Ok(_) if !resume => Err(CliError::input(format!(
                "{} exists: resume it with --resume, or name another one with --log",
                path.display()
            ))),
            _ => Log::read(path).map(Some).map_err(CliError::input),
        }
    }

    /// Appends to a log that was read.
    pub(super) fn append(path: &Path, log: Log) -> Result<Self, CliError> {
        let writer = LogWriter::append(path).map_err(|error| CliError::writing(path, error))?;
        let Log { header, events, .. } = log;
        Ok(Self { path: path.to_owned(), writer: Some(writer), header, events })
    }

    /// Writes an event.
    pub(super) fn event(&mut self, event: Event) -> Result<(), CliError> {
        self.write(&event).map_err(|error| CliError::writing(&self.path, error))?;
        self.events.push(event);
        Ok(())
    }

    fn write(&mut self, event: &Event) -> io::Result<()> {
        if self.writer.is_none() {
            if let Some(folder) = self.path.parent() {
                fs::create_dir_all(folder)?;
            }
            let file = OpenOptions::new().write(true).create_new(true).open(&self.path)?;
            self.writer = Some(LogWriter::new(file, &self.header)?);
        }
        self.writer.as_mut().map_or(Ok(()), |writer| writer.event(event))
    }
}
