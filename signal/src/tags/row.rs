//! Lines of a table with named columns, each error with file, line, field and value.

use std::{fs, path::Path};

use super::TagError;

/// Reads the bytes of a file.
pub(super) fn bytes_of(file: &Path) -> Result<Vec<u8>, TagError> {
    fs::read(file).map_err(|source| TagError::Read { file: file.to_owned(), source })
}

/// A table with a header.
pub(super) struct Rows<'a> {
    file: &'a Path,
    columns: Vec<String>,
    rows: Vec<(u64, csv::StringRecord)>,
}

/// One line of it.
#[derive(Clone, Copy)]
pub(super) struct Row<'a> {
    rows: &'a Rows<'a>,
    pub(super) line: u64,
    record: &'a csv::StringRecord,
}

impl<'a> Rows<'a> {
    /// Reads what a file holds: fields are separated by `,` or, where the header has one, by `;`.
    pub(super) fn parse(file: &'a Path, bytes: &[u8]) -> Result<Self, TagError> {
        let header = bytes.split(|byte| *byte == b'\n').next().unwrap_or_default();
        let delimiter = if header.contains(&b';') { b';' } else { b',' };
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(delimiter)
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(bytes);
        let problem = |error: csv::Error| TagError::Line {
            file: file.to_owned(),
            line: error.position().map_or(1, csv::Position::line),
            problem: error.to_string(),
        };
        let header = reader.headers().map_err(problem)?;
        let columns = header.iter().map(|c| c.trim_start_matches('\u{feff}').to_owned()).collect();
        let mut rows = Vec::new();
        for record in reader.records() {
            let record = record.map_err(problem)?;
            rows.push((record.position().map_or(0, csv::Position::line), record));
        }
        Ok(Self { file, columns, rows })
    }

    pub(super) fn has(&self, columns: &[&str]) -> bool {
        columns.iter().all(|wanted| self.columns.iter().any(|column| column == wanted))
    }

    /// The error of a header that none of the readers knows.
    pub(super) fn unknown(&self, wanted: &'static str) -> TagError {
        let columns = self.columns.join(", ");
        TagError::Header { file: self.file.to_owned(), columns, wanted }
    }

    pub(super) fn iter(&'a self) -> impl Iterator<Item = Row<'a>> {
        self.rows.iter().map(|(line, record)| Row { rows: self, line: *line, record })
    }
}

impl<'a> Row<'a> {
    /// The text of a column; `None` if there is no such column or its field is empty.
    pub(super) fn text(&self, column: &str) -> Option<&'a str> {
        let index = self.rows.columns.iter().position(|name| name == column)?;
        self.record.get(index).filter(|text| !text.is_empty())
    }

    /// An error in a column.
    pub(super) fn error(&self, field: &str, requirement: &'static str) -> TagError {
        TagError::Field {
            file: self.rows.file.to_owned(),
            line: self.line,
            field: field.to_owned(),
            value: self.text(field).unwrap_or_default().to_owned(),
            requirement,
        }
    }

    /// A name that occurs twice.
    pub(super) fn twice(&self, name: &str) -> TagError {
        TagError::Twice { file: self.rows.file.to_owned(), line: self.line, name: name.to_owned() }
    }

    /// A finite number.
    pub(super) fn number(&self, column: &str) -> Result<f64, TagError> {
        let read = self.text(column).and_then(|text| text.parse::<f64>().ok());
        read.filter(|x| x.is_finite()).ok_or_else(|| self.error(column, "a finite number"))
    }

    /// A number above zero.
    pub(super) fn positive(&self, column: &str) -> Result<f64, TagError> {
        let read = self.number(column).ok().filter(|x| *x > 0.0);
        read.ok_or_else(|| self.error(column, "a number above 0"))
    }

    /// A number above zero, or nothing.
    pub(super) fn optional(&self, column: &str) -> Result<Option<f64>, TagError> {
        self.text(column).map(|_| self.positive(column)).transpose()
    }
}
