use std::{
    fs::{File, OpenOptions},
    io::{self, Read, Seek, SeekFrom, Write},
    path::Path,
};

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
    /// The error of the writer.
    pub fn new(out: W, header: &LogHeader) -> io::Result<Self> {
        let mut writer = Self { out };
        writer.line(header)?;
        Ok(writer)
    }

    /// Adds an event.
    ///
    /// # Errors
    ///
    /// The error of the writer.
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

impl LogWriter<File> {
    /// Goes on behind the last whole line of a log file; what [`Log::read`](super::Log::read) calls
    /// torn is cut off, and nothing else.
    ///
    /// # Errors
    ///
    /// The error of the writer.
    pub fn append(path: &Path) -> io::Result<Self> {
        let mut out = OpenOptions::new().read(true).write(true).open(path)?;
        let mut text = Vec::new();
        out.read_to_end(&mut text)?;
        let whole = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |last| last + 1);
        let rest = &text[whole..];
        if serde_json::from_slice::<Event>(rest).is_ok() {
            // All of the last line but its end was written.
            out.seek(SeekFrom::End(0))?;
            out.write_all(b"\n")?;
        } else {
            let whole = u64::try_from(whole).map_err(io::Error::other)?;
            out.set_len(whole)?;
            out.seek(SeekFrom::Start(whole))?;
        }
        Ok(Self { out })
    }
}
