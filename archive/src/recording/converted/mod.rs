//! Files of other shapes than a table, as a table: objects of JSON, detections of tags, packets,
//! lines on a map, spreadsheets.

mod aprs;
mod ats;
mod flight;
mod gpx;
mod json;
mod kml;
mod lotek;
mod rows;
mod sensorgnome;
#[cfg(feature = "spreadsheets")]
mod spreadsheet;
#[cfg(feature = "sqlite")]
mod sqlite;
mod xctu;

use self::rows::not_written;
pub(super) use self::rows::{Converted, Made, Rows};
use super::RecordingError;

/// Makes a table of a file, by its contents; `None` for any other. `sheet` is the name of the sheet
/// to read of a spreadsheet, `level` that of the levels to read of an autopilot's log or a GPX
/// track; of a table its column is read later.
pub(super) fn convert(
    bytes: &[u8],
    file: &str,
    sheet: Option<&str>,
    level: Option<&str>,
) -> Result<Option<Converted>, RecordingError> {
    #[cfg(feature = "spreadsheets")]
    if let Some(converted) = spreadsheet::convert(bytes, file, sheet)? {
        return Ok(Some(converted));
    }
    if let Some(sheet) = sheet {
        let sheet = sheet.to_owned();
        return Err(RecordingError::NoSheet { file: file.to_owned(), sheet, sheets: Vec::new() });
    }
    if let Some(converted) = flight::convert(bytes, file, level)? {
        return Ok(Some(converted));
    }
    if let Some(converted) = gpx::convert(bytes, file, level)? {
        return Ok(Some(converted));
    }
    if let Some(converted) = kml::convert(bytes, file)? {
        return Ok(Some(converted));
    }
    #[cfg(feature = "sqlite")]
    if let Some(converted) = sqlite::convert_kismet(bytes, file)? {
        return Ok(Some(converted));
    }
    #[cfg(feature = "sqlite")]
    if let Some(converted) = sqlite::convert_df_aggregator(bytes, file)? {
        return Ok(Some(converted));
    }
    if let Some(rows) = json::convert(bytes, file)? {
        return Ok(Some(Converted { table: Made::Rows(rows), what: String::new() }));
    }
    let text = String::from_utf8_lossy(bytes);
    let converted = sensorgnome::convert(&text)
        .or_else(|| aprs::convert(&text))
        .or_else(|| lotek::convert(&text));
    if let Some(made) = converted {
        return made.map(Some).map_err(|error| not_written(file, error));
    }
    match ats::convert(&text, file)? {
        Some(made) => Ok(Some(made)),
        None => xctu::convert(&text, file),
    }
}
