use std::io::{self, Write};

use super::LogHeader;
use crate::hunt::Event;

/// Writes a log, a line at a time; each line is flushed, so that a crash loses nothing before it.
#[derive(Debug)]
pub struct LogWriter<W> {
    out: W,
}

impl<W: Write> LogWriter<W> {
    /// Begins a log with its header.
    ///
    /// # Errors
    ///
    /// Whatever the file says.
    pub fn new(out: W, header: &LogHeader) -> io::Result<Self> {
        let mut writer = Self { out };
        writer.line(header)?;
        Ok(writer)
    }

    /// Adds an event.
    ///
    /// # Errors
    ///
    /// Whatever the file says.
    pub fn event(&mut self, event: &Event) -> io::Result<()> {
        self.line(event)
    }

    fn line(&mut self, value: &impl serde::Serialize) -> io::Result<()> {
        // One write for each line: two programs that append never mix within a line.
        let mut line = serde_json::to_vec(value)?;
        line.push(b'\n');
        self.out.write_all(&line)?;
        self.out.flush()
    }
}
