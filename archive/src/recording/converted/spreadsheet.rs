use std::io::Cursor;

use calamine::{Data, ExcelDateTime, Range, Reader, open_workbook_auto_from_rs};

use super::rows::{Converted, Made, not_written};
use crate::recording::RecordingError;

/// First bytes of a ZIP archive, as `.xlsx`, `.xlsb` and `.ods` are.
const ZIP: &[u8] = b"PK\x03\x04";

/// First bytes of `.xls`, and of an `.xlsx` with a password.
const OLE: &[u8] = b"\xd0\xcf\x11\xe0";

/// A sheet of a spreadsheet: the one of this name, or the first with more than one row.
pub(super) fn convert(
    bytes: &[u8],
    file: &str,
    sheet: Option<&str>,
) -> Result<Option<Converted>, RecordingError> {
    if ![ZIP, OLE].iter().any(|magic| bytes.starts_with(magic)) {
        return Ok(None);
    }
    let mut book = match open_workbook_auto_from_rs(Cursor::new(bytes)) {
        Ok(book) => book,
        Err(error) if bytes.starts_with(OLE) => return Err(not_written(file, error)),
        // Another archive is named by its own error.
        Err(_) => return Ok(None),
    };
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

fn table(range: &Range<Data>) -> csv::Result<Vec<u8>> {
    let first = range.start().map_or(0, |(row, _)| row);
    // Rows without a cell are empty lines: a line of the table has the number of its row.
    let mut table = vec![b'\n'; first as usize];
    for row in range.rows() {
        if row.iter().all(|cell| *cell == Data::Empty) {
            table.push(b'\n');
        } else {
            let mut writer = csv::Writer::from_writer(&mut table);
            writer.write_record(row.iter().map(text))?;
            writer.flush()?;
        }
    }
    Ok(table)
}

/// A cell as it would be typed: dates and times as ISO 8601 has them, errors as they are shown.
fn text(cell: &Data) -> String {
    match cell {
        Data::Empty => String::new(),
        Data::Float(number) => number.to_string(),
        Data::DateTime(moment) => date(moment),
        Data::DurationIso(time) => duration(time).unwrap_or_else(|| time.clone()),
        // A row is a line.
        other => other.to_string().replace(['\r', '\n'], " "),
    }
}

/// A day, a day with a time, a time of the day, or hours, minutes and seconds that have passed.
fn date(moment: &ExcelDateTime) -> String {
    let days = moment.as_f64();
    if moment.is_duration() || days < 1.0 {
        return hours(86_400.0 * days);
    }
    let (year, month, day, hour, minute, second, millisecond) = moment.to_ymd_hms_milli();
    let date = format!("{year:04}-{month:02}-{day:02}");
    if days.fract().abs() < f64::MIN_POSITIVE {
        return date;
    }
    let time = format!("{hour:02}:{minute:02}:{second:02}.{millisecond:03}");
    format!("{date} {}", time.strip_suffix(".000").unwrap_or(&time))
}

/// Hours, minutes and seconds of `PT14H03M00S`, as an OpenDocument has a time; `None` for days and
/// longer, and for any other text.
fn duration(text: &str) -> Option<String> {
    let mut left = text.strip_prefix("PT")?;
    let mut seconds = 0.0;
    for (unit, each) in [('H', 3600.0), ('M', 60.0), ('S', 1.0)] {
        if let Some((number, rest)) = left.split_once(unit) {
            seconds += each * number.parse::<f64>().ok()?;
            left = rest;
        }
    }
    left.is_empty().then(|| hours(seconds))
}

/// `HH:MM:SS`, with milliseconds where there are any.
fn hours(seconds: f64) -> String {
    #[expect(clippy::cast_possible_truncation, reason = "casts saturate, at 10^8 years")]
    let whole = (seconds * 1e3).round() as i64;
    let time = format!(
        "{:02}:{:02}:{:02}.{:03}",
        whole / 3_600_000,
        whole / 60_000 % 60,
        whole / 1000 % 60,
        whole % 1000
    );
    time.strip_suffix(".000").unwrap_or(&time).to_owned()
}

#[cfg(test)]
mod tests {
    use calamine::ExcelDateTimeType;

    use super::*;

    #[test]
    fn times_of_the_day_and_durations_are_hours() {
        let moment = |days, kind| date(&ExcelDateTime::new(days, kind, false));
        let day = ExcelDateTimeType::DateTime;
        assert_eq!(moment(46_194.0, day), "2026-06-21");
        assert_eq!(moment(46_194.585_416_666_66, day), "2026-06-21 14:03:00");
        assert_eq!(moment(0.585_416_666_666_666_7, day), "14:03:00");
        assert_eq!(moment(26.0 / 24.0, ExcelDateTimeType::TimeDelta), "26:00:00");
        assert_eq!(duration("PT14H03M00S").as_deref(), Some("14:03:00"));
        assert_eq!(duration("PT5M").as_deref(), Some("00:05:00"));
        assert_eq!(duration("PT1.5S").as_deref(), Some("00:00:01.500"));
        assert_eq!(duration("P1DT1H"), None);
    }

    #[test]
    fn a_row_without_cells_is_an_empty_line() {
        let mut range = Range::new((1, 0), (4, 1));
        range.set_value((1, 0), Data::String("lat".into()));
        range.set_value((1, 1), Data::String("a, b".into()));
        range.set_value((4, 0), Data::Float(48.25));
        let table = String::from_utf8(table(&range).expect("in memory")).expect("text");
        assert_eq!(table, "\nlat,\"a, b\"\n\n\n48.25,\n");
    }
}
