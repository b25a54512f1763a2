use std::{
    fs::{File, OpenOptions},
    io::{self, Read, Seek, SeekFrom, Write},
    path::Path,
};

use super::LogHeader;
use crate::{document, hunt::Event};

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
    #[inline]
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
    #[inline]
    pub fn event(&mut self, event: &Event) -> io::Result<()> {
        self.line(event)
    }

    #[inline]
    fn line(&mut self, value: &impl serde::Serialize) -> io::Result<()> {
        // One write for each line: two programs that append never mix within a line.
        let mut line = document::to_json(value)?;
        line.push('\n');
        self.out.write_all(line.as_bytes())?;
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
    #[inline]
    pub fn append(path: &Path) -> io::Result<Self> {
        let mut out = OpenOptions::new().read(true).write(true).open(path)?;
        let mut text = Vec::new();
        out.read_to_end(&mut text)?;
        let whole = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |last| last + 1);
        let rest = &text[whole..];
        let whole_event =
            str::from_utf8(rest).is_ok_and(|rest| document::from_json::<Event>(rest).is_ok());
        if whole_event {
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
