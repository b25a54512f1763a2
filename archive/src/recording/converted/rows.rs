use std::io;

use crate::recording::RecordingError;

/// A table that was made of a file.
#[derive(Debug)]
pub(in crate::recording) struct Converted {
    /// The table.
    pub table: Made,
    /// The file's kind and the part of it that was read, as the end of a sentence; empty where
    /// all of the file is read, and its format says the rest.
    pub what: String,
}

/// A table in memory.
#[derive(Debug)]
pub(in crate::recording) enum Made {
    /// CSV in UTF-8, in which a header is still to be found: the lines are the file's rows.
    #[cfg_attr(not(feature = "spreadsheets"), expect(dead_code, reason = "of spreadsheets alone"))]
    Text(Vec<u8>),
    /// Rows under a header that is known.
    Rows(Rows),
}

/// Rows that were made of a file of another shape, each with its line there.
#[derive(Debug, Default, PartialEq)]
pub(in crate::recording) struct Rows {
    /// The names of the columns.
    pub header: Vec<String>,
    /// The rows as CSV without a header; a row may have fewer cells than there are columns.
    pub csv: Vec<u8>,
    /// The line of the file in which each row begins.
    pub lines: Vec<u64>,
    /// Lines that cannot be read, each with the reason.
    pub broken: Vec<(u64, String)>,
    /// True if the rows have the levels that were named, so that no column is looked for.
    pub has_named_level: bool,
}

/// Rows that are being written.
pub(super) struct RowsWriter {
    pub rows: Rows,
    writer: csv::Writer<Vec<u8>>,
}

impl RowsWriter {
    /// No rows as yet.
    pub(super) fn new(header: &[&str]) -> Self {
        let header = header.iter().map(|name| (*name).to_owned()).collect();
        // Every cell is quoted, so that no row looks like a comment.
        let writer = csv::WriterBuilder::new()
            .flexible(true)
            .quote_style(csv::QuoteStyle::Always)
            .from_writer(Vec::new());
        Self { rows: Rows { header, ..Rows::default() }, writer }
    }

    /// Writes a row that begins in a line of the file.
    pub(super) fn write<C: AsRef<[u8]>>(&mut self, line: u64, cells: &[C]) -> csv::Result<()> {
        self.writer.write_record(cells)?;
        self.rows.lines.push(line);
        Ok(())
    }

    /// All rows that were written.
    pub(super) fn finish(self) -> io::Result<Rows> {
        let csv = self.writer.into_inner().map_err(csv::IntoInnerError::into_error)?;
        Ok(Rows { csv, ..self.rows })
    }
}

/// An error of reading the other shape, or of writing the table.
pub(super) fn not_written(
    file: &str,
    source: impl Into<Box<dyn std::error::Error + Send + Sync>>,
) -> RecordingError {
    RecordingError::Read { file: file.to_owned(), source: std::io::Error::other(source) }
}
