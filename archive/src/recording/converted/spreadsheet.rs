use std::io::Cursor;

use calamine::{Data, ExcelDateTime, Range, Reader, open_workbook_auto_from_rs};

use super::{Converted, Made, not_written};
use crate::recording::RecordingError;

/// First bytes of a ZIP archive, as `.xlsx`, `.xlsb` and `.ods` are, and of `.xls`.
const MAGIC: [&[u8]; 2] = [b"PK\x03\x04", b"\xd0\xcf\x11\xe0"];

/// A sheet of a spreadsheet: the one of this name, or the first with more than one row.
pub(super) fn convert(
    bytes: &[u8],
    file: &str,
    sheet: Option<&str>,
) -> Result<Option<Converted>, RecordingError> {
    if !MAGIC.iter().any(|magic| bytes.starts_with(magic)) {
        return Ok(None);
    }
    // Another archive is named by its own error.
    let Ok(mut book) = open_workbook_auto_from_rs(Cursor::new(bytes)) else { return Ok(None) };
    let names = book.sheet_names();
    let wanted: Vec<&String> = match sheet {
        Some(sheet) => names.iter().filter(|name| name.as_str() == sheet).collect(),
        None => names.iter().collect(),
    };
    for name in wanted {
        let range = book.worksheet_range(name).map_err(|error| not_written(file, error))?;
        if sheet.is_none() && range.height() < 2 {
            continue;
        }
        let table = table(&range).map_err(|error| not_written(file, error))?;
        let others: Vec<&str> =
            names.iter().filter(|other| *other != name).map(String::as_str).collect();
        let others = match others.as_slice() {
            [] => String::new(),
            others => format!("; others are read with --sheet: {}", others.join(", ")),
        };
        let what = format!("a spreadsheet, of which the sheet {name:?} is read{others}");
        return Ok(Some(Converted { table: Made::Text(table), what }));
    }
    let sheet = sheet.unwrap_or_default().to_owned();
    Err(RecordingError::NoSheet { file: file.to_owned(), sheet, sheets: names })
}

fn table(range: &Range<Data>) -> Result<Vec<u8>, csv::Error> {
    let first = range.start().map_or(0, |(row, _)| row);
    // Rows without a cell are empty lines: a line of the table has the number of its row.
    let mut writer = csv::Writer::from_writer(vec![b'\n'; first as usize]);
    for row in range.rows() {
        if row.iter().any(|cell| *cell != Data::Empty) {
            writer.write_record(row.iter().map(text))?;
        } else {
            writer.write_record([""; 0])?;
        }
    }
    Ok(writer.into_inner().map_err(csv::IntoInnerError::into_error)?)
}

/// A cell as it would be typed: dates and times as ISO 8601 has them.
fn text(cell: &Data) -> String {
    match cell {
        Data::Empty | Data::Error(_) => String::new(),
        Data::Float(number) => number.to_string(),
        Data::DateTime(moment) => date(moment),
        // PT14H03M00S of an OpenDocument is a time of the day.
        Data::DurationIso(time) => {
            time.trim_start_matches("PT").trim_end_matches('S').replace(['H', 'M'], ":")
        }
        // A row is a line.
        other => other.to_string().replace(['\r', '\n'], " "),
    }
}

/// A day, a day with a time, or a time of the day.
fn date(moment: &ExcelDateTime) -> String {
    let (year, month, day, hour, minute, second, millisecond) = moment.to_ymd_hms_milli();
    let days = moment.as_f64();
    let time = format!("{hour:02}:{minute:02}:{second:02}.{millisecond:03}");
    let time = time.strip_suffix(".000").unwrap_or(&time);
    if days < 1.0 {
        time.to_owned()
    } else if days.fract().abs() < f64::MIN_POSITIVE {
        format!("{year:04}-{month:02}-{day:02}")
    } else {
        format!("{year:04}-{month:02}-{day:02} {time}")
    }
}
