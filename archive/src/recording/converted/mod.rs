//! Files of other shapes than a table, as a table: objects of JSON, detections of tags, packets,
//! lines on a map, spreadsheets.

mod aprs;
mod ats;
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

pub(super) use rows::{Converted, Made, Rows};

use foxhunt_hunt::log::LOG_BEGIN;

use self::rows::{RowsWriter, not_written};
use super::{
    RecordingError, Rover,
    flight_log::{Kind, Levels},
    utc::utc,
};

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
    if let Some(converted) = convert_flight_log(bytes, file, level)? {
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
    if bytes.starts_with(LOG_BEGIN) {
        return Ok(None);
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

/// Levels in an autopilot's log, each at the vehicle's place; `None` for a log without levels,
/// which is a path alone, and for any other file. `level` is the name of the levels to read: a log
/// without them is refused.
fn convert_flight_log(
    bytes: &[u8],
    file: &str,
    level: Option<&str>,
) -> Result<Option<Converted>, RecordingError> {
    let Some(kind) = Kind::of(bytes) else { return Ok(None) };
    let log = match kind.log(bytes) {
        Ok(log) => log,
        Err(_) if level.is_none() => return Ok(None),
        Err(problem) => {
            let file = file.to_owned();
            return Err(RecordingError::NoPath { file, what: kind.name(), problem });
        }
    };
    if level.is_none() && log.levels.is_empty() {
        return Ok(None);
    }
    let Some((name, levels)) = log.levels.chosen(level) else {
        return Err(RecordingError::ChooseLevel {
            file: file.to_owned(),
            what: kind.name(),
            named: level.map(str::to_owned),
            levels: log.levels.listed(),
        });
    };
    let what = format!(
        "{}, whose levels {name} were read at its places, {}; --level takes another one of {}",
        kind.name(),
        Levels::scale(name),
        log.levels.listed()
    );
    let rover = Rover::of_fixes(log.fixes, file)?;
    let mut made = RowsWriter::new(&["time_utc", "rss_db", "lat_deg", "lon_deg", "alt_m"]);
    for ([time, level], line) in levels.iter().zip(1..) {
        let place = rover.place(*time);
        let cell = |of: fn(&foxhunt_wire::geodesy::Geodetic) -> f64, digits: usize| {
            place.as_ref().map_or_else(String::new, |place| format!("{:.digits$}", of(place)))
        };
        let cells = [
            utc(*time),
            format!("{level:.2}"),
            cell(|place| place.lat_deg, 8),
            cell(|place| place.lon_deg, 8),
            cell(|place| place.alt_m, 2),
        ];
        made.write(line, &cells).map_err(|error| not_written(file, error))?;
    }
    made.rows.has_named_level = true;
    let rows = made.finish().map_err(|error| not_written(file, error))?;
    Ok(Some(Converted { table: Made::Rows(rows), what }))
}
