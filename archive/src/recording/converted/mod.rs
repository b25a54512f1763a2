//! Files of other shapes than a table, as a table: objects of JSON, detections of tags, packets,
//! spreadsheets.

mod aprs;
mod json;
#[cfg(feature = "sqlite")]
mod kismet;
mod rows;
mod sensorgnome;
#[cfg(feature = "spreadsheets")]
mod spreadsheet;

pub(super) use self::rows::Rows;
use self::rows::RowsWriter;
use super::RecordingError;

/// A table that was made of a file.
#[derive(Debug)]
pub(super) struct Converted {
    /// The table.
    pub(super) table: Made,
    /// The file's kind and the part of it that was read, as the end of a sentence; empty where
    /// all of the file is read, and its format says the rest.
    pub(super) what: String,
}

/// A table in memory.
#[derive(Debug)]
pub(super) enum Made {
    /// CSV in UTF-8, in which a header is still to be found: the lines are the file's rows.
    #[cfg_attr(not(feature = "spreadsheets"), expect(dead_code, reason = "of spreadsheets alone"))]
    Text(Vec<u8>),
    /// Rows under a header that is known.
    Rows(Rows),
}

/// Makes a table of a file, by its contents; `None` for any other. `sheet` is the name of the sheet
/// to read of a spreadsheet.
pub(super) fn convert(
    bytes: &[u8],
    file: &str,
    sheet: Option<&str>,
) -> Result<Option<Converted>, RecordingError> {
    #[cfg(feature = "spreadsheets")]
    if let Some(converted) = spreadsheet::convert(bytes, file, sheet)? {
        return Ok(Some(converted));
    }
    if let Some(sheet) = sheet {
        let sheet = sheet.to_owned();
        return Err(RecordingError::NoSheet { file: file.to_owned(), sheet, sheets: Vec::new() });
    }
    #[cfg(feature = "sqlite")]
    if let Some(converted) = kismet::convert(bytes, file)? {
        return Ok(Some(converted));
    }
    if let Some(rows) = json::convert(bytes, file)? {
        return Ok(Some(Converted { table: Made::Rows(rows), what: String::new() }));
    }
    let text = String::from_utf8_lossy(bytes);
    let converted = sensorgnome::convert(&text).or_else(|| aprs::convert(&text));
    converted.map(|made| made.map_err(|error| not_written(file, error))).transpose()
}

/// An error of reading the other shape, or of writing the table.
fn not_written(
    file: &str,
    source: impl Into<Box<dyn std::error::Error + Send + Sync>>,
) -> RecordingError {
    RecordingError::Read { file: file.to_owned(), source: std::io::Error::other(source) }
}
