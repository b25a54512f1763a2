use std::{collections::BTreeSet, path::Path};

use chrono::{NaiveDate, NaiveDateTime, NaiveTime};

use super::rows::{Converted, Made, RowsWriter, not_written};
use crate::recording::{RecordingError, utm::UtmZone};

/// Lines in which a file is recognised.
const HEAD: usize = 20;

/// The programs that write such a file begin with this name; their version is in the head.
const PROGRAM: &str = "ATSWinRec";

/// Text in place of the tag, in a row that holds the receiver's place alone.
const NOTHING: &str = "NA";

/// Least distance in metres of a place in UTM from its zone's origin.
const LEAST_UTM_M: f64 = 1000.0;

/// Detections of a receiver of Advanced Telemetry Systems (R4500S, R4500C), as the programs
/// `ATSWinRec` write them: a head of some lines, and a row for each detection.
///
/// Newer files name their columns: `Yr,Day,Hr,Mn,Ant,Fr,Sig,Code,NumDet,NumMort,DataInd,Data`, or
/// without codes `Yr,Day,Hr,Mn,Ant,Fr,Sig,NumPls,PR,NumMatch` (us-amlr/tamatoamlr,
/// `inst/extdata`). In older files the number of cells tells them (AKROGIS/LACL_Fish,
/// `ATSWinRec.cs`): nine of a receiver that stands, eleven with latitude and longitude from the
/// air, twelve with a place in UTM; or twelve of a receiver that stands, with the level behind the
/// code. The day is that of the year, or a date (R4500S Reference User Manual R05-11-A, section
/// 16). A signal strength is a number from 40 to 154 there, without a unit.
pub(super) fn convert(text: &str, file: &str) -> Result<Option<Converted>, RecordingError> {
    if !text.lines().take(HEAD).any(|line| line.contains(PROGRAM)) {
        return Ok(None);
    }
    // Rows that cannot be read are named one by one.
    if rows_of(text).all(|(_, row)| matches!(row, Ok(None))) {
        return Err(RecordingError::NotATable {
            file: file.to_owned(),
            what: "a file of an ATS receiver without a detection",
            advice: "give one with detections, and the receiver's path beside it where they have \
                     no places: foxhunt locate TRACK.gpx DETECTIONS.csv"
                .to_owned(),
        });
    }
    table(text, file).map(Some).map_err(|error| not_written(file, error))
}

fn table(text: &str, file: &str) -> csv::Result<Converted> {
    let detections = || rows_of(text).filter_map(|(_, row)| row.ok().flatten());
    let has_places = detections().any(|of| of.place.is_some());
    let antennas: BTreeSet<&str> = detections().filter_map(|of| of.antenna).collect();
    // One antenna is the receiver, which is called as its file.
    let has_antennas = antennas.len() > 1;
    let mut header = vec!["ATS time", "ATS transmitter", "ATS signal"];
    header.extend(has_antennas.then_some("ATS antenna"));
    let place = ["ATS latitude", "ATS longitude"];
    header.extend(has_places.then_some(place).into_iter().flatten());
    let mut rows = RowsWriter::new(&header);
    let stem = Path::new(file).file_stem().unwrap_or_default().to_string_lossy();
    let mut without = 0_u64;
    for (number, row) in rows_of(text) {
        let found = match row {
            Ok(Some(found)) => found,
            Ok(None) => {
                without += 1;
                continue;
            }
            Err(problem) => {
                rows.rows.broken.push((number, problem));
                continue;
            }
        };
        let drone = format!("{stem} {}", found.antenna.unwrap_or_default());
        let mut cells = vec![found.time.as_str(), &found.beacon, found.level];
        cells.extend(has_antennas.then_some(drone.as_str()));
        let place = found.place.unwrap_or_default();
        cells.extend(has_places.then_some(place.each_ref().map(String::as_str)).iter().flatten());
        rows.write(number, &cells)?;
    }
    let drone = if has_antennas { "a drone the file and an antenna, " } else { "" };
    let without = match without {
        0 => String::new(),
        without => format!("; rows without a detection are left out: {without}"),
    };
    let what = format!(
        "detections of a receiver of Advanced Telemetry Systems; a beacon is a frequency and a \
         code, {drone}and a unit of signal strength counts as a decibel{without}"
    );
    Ok(Converted { table: Made::Rows(rows.finish()?), what })
}

/// A detection.
struct Detection<'l> {
    time: String,
    beacon: String,
    antenna: Option<&'l str>,
    level: &'l str,
    /// Latitude and longitude in degrees.
    place: Option<[String; 2]>,
}

/// Indices of the cells behind the time.
#[derive(Clone, Copy, Default)]
struct Layout {
    second: Option<usize>,
    antenna: Option<usize>,
    frequency: usize,
    code: Option<usize>,
    level: usize,
    /// Latitude and longitude.
    degrees: Option<[usize; 2]>,
    /// East, North and zone of UTM.
    utm: Option<[usize; 3]>,
}

/// The rows of a file with their lines; `None` for a row without a detection.
fn rows_of(text: &str) -> impl Iterator<Item = (u64, Result<Option<Detection<'_>>, String>)> {
    let mut named = None;
    (1..).zip(text.lines()).filter_map(move |(number, line)| {
        let cells = cells(line);
        let is_header = ["Yr", "Year"].contains(cells.first()?);
        if is_header {
            named = Layout::named(&cells);
        }
        let is_row = cells.len() > 4 && cells.first()?.starts_with(|c: char| c.is_ascii_digit());
        is_row.then(|| (number, row(&cells, named)))
    })
}

/// Returns the cells of a line without the empty cells at its end.
fn cells(line: &str) -> Vec<&str> {
    let separators = [';', '\t'];
    let separator = separators.into_iter().find(|sign| line.contains(*sign)).unwrap_or(',');
    let cell = |cell| str::trim_matches(cell, |c: char| c.is_whitespace() || c == '"');
    let mut cells: Vec<&str> = line.split(separator).map(cell).collect();
    while cells.last().is_some_and(|cell| cell.is_empty()) {
        cells.pop();
    }
    cells
}

impl Layout {
    /// The layout of a header that names the columns.
    fn named(header: &[&str]) -> Option<Self> {
        let at = |names: &[&str]| header.iter().position(|name| names.contains(name));
        Some(Self {
            second: at(&["Sc", "Sec"]),
            antenna: at(&["Ant"]),
            frequency: at(&["Fr", "Freq"])?,
            code: at(&["Code"]),
            level: at(&["Sig", "SS"])?,
            degrees: at(&["Lat", "Latitude"])
                .zip(at(&["Lon", "Long", "Longitude"]))
                .map(<[usize; 2]>::from),
            utm: None,
        })
    }

    /// The layout of a row whose columns have no names.
    fn of(cells: &[&str]) -> Result<Self, String> {
        let second = Some(4);
        let tag = Self { frequency: 5, code: Some(6), level: 7, ..Self::default() };
        let is_metres = |at: usize| {
            let metres = cells.get(at).and_then(|cell| cell.parse::<f64>().ok());
            metres.is_some_and(|metres| metres.abs() >= LEAST_UTM_M)
        };
        match cells.len() {
            11 => Ok(Self { second, degrees: Some([8, 9]), ..tag }),
            12 if is_metres(8) && is_metres(9) => Ok(Self { second, utm: Some([8, 9, 10]), ..tag }),
            9 | 12 => Ok(Self { antenna: Some(4), ..tag }),
            count => Err(format!("{count} cells, where a detection has 9, 11 or 12")),
        }
    }
}

fn row<'l>(cells: &[&'l str], named: Option<Layout>) -> Result<Option<Detection<'l>>, String> {
    // A date and time take one cell, the day of a year four.
    let is_date = cells.first().is_some_and(|cell| cell.contains('/'));
    let spread: Vec<&str> = match is_date {
        true => [""; 3].into_iter().chain(cells.iter().copied()).collect(),
        false => cells.to_vec(),
    };
    let layout = match named {
        Some(layout) => layout,
        None => Layout::of(&spread)?,
    };
    let cell = |at: usize, name: &str| {
        let missing = || format!("the cell of the {name} is missing");
        spread.get(at).copied().filter(|cell| !cell.is_empty()).ok_or_else(missing)
    };
    let frequency = cell(layout.frequency, "frequency")?;
    if frequency == NOTHING {
        return Ok(None);
    }
    let second = layout.second.map_or(Ok("0"), |at| cell(at, "second"))?;
    let whole = |text: &str| text.parse::<u32>().map_err(|_| format!("{text} is no whole number"));
    let time = match is_date {
        true => date(cell(3, "date")?)?,
        false => {
            let part = |at: usize, name: &str| cell(at, name).and_then(whole);
            let day = [part(0, "year")?, part(1, "day")?];
            day_of_year(day, [part(2, "hour")?, part(3, "minute")?, whole(second)?])?
        }
    };
    let level = cell(layout.level, "signal strength")?;
    let code = layout.code.map(|at| cell(at, "code")).transpose()?;
    let frequency = megahertz(frequency);
    let degrees = |[lat, lon]: [usize; 2]| {
        Ok::<_, String>([cell(lat, "latitude")?.to_owned(), cell(lon, "longitude")?.to_owned()])
    };
    let metres = |[east, north, zone]: [usize; 3]| {
        let number = |at: usize, name: &str| {
            let text = cell(at, name)?;
            text.parse::<f64>().map_err(|_| format!("{text} is no number"))
        };
        let written = cell(zone, "zone")?;
        let zone: UtmZone = written.parse().map_err(|problem| format!("{written} {problem}"))?;
        let degrees = zone.degrees(number(east, "east")?, number(north, "north")?);
        Ok::<_, String>(degrees.map(|degrees| format!("{degrees:.7}")))
    };
    let place = match (layout.degrees, layout.utm) {
        (Some(at), _) => Some(degrees(at)?),
        (None, Some(at)) => Some(metres(at)?),
        (None, None) => None,
    };
    Ok(Some(Detection {
        time,
        beacon: code.map_or_else(|| frequency.clone(), |code| format!("{frequency} {code}")),
        antenna: layout.antenna.map(|at| cell(at, "antenna")).transpose()?,
        level,
        place,
    }))
}

/// A frequency of six digits in kilohertz as megahertz; one of four lacks its begin and is kept.
fn megahertz(written: &str) -> String {
    let is_whole = written.len() == 6 && written.bytes().all(|byte| byte.is_ascii_digit());
    match written.split_at_checked(3).filter(|_| is_whole) {
        Some((mega, kilo)) => format!("{mega}.{kilo}"),
        None => written.to_owned(),
    }
}

fn day_of_year([year, day]: [u32; 2], [hour, minute, second]: [u32; 3]) -> Result<String, String> {
    let full = if year < 100 { year + 2000 } else { year };
    let date = i32::try_from(full).ok().and_then(|year| NaiveDate::from_yo_opt(year, day));
    let date = date.ok_or_else(|| format!("there is no day {day} in the year {year}"))?;
    let time = NaiveTime::from_hms_opt(hour, minute, second)
        .ok_or_else(|| format!("{hour}:{minute}:{second} is no time of a day"))?;
    Ok(date.and_time(time).to_string())
}

/// Month, day, year and time.
fn date(text: &str) -> Result<String, String> {
    let read = |format| NaiveDateTime::parse_from_str(text, format).ok();
    let time = read("%m/%d/%Y %H:%M").or_else(|| read("%m/%d/%Y %H:%M:%S"));
    let time =
        time.ok_or_else(|| format!("{text} is no date and time such as 06/21/2026 14:03"))?;
    Ok(time.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::converted::Rows;

    fn read(text: &str) -> (Rows, String) {
        let made = convert(text, "f.csv").expect("detections");
        let Converted { table, what } = made.expect("one");
        let Made::Rows(rows) = table else { panic!("rows") };
        (rows, what)
    }

    fn csv(rows: Rows) -> String {
        String::from_utf8(rows.csv).expect("text").replace('"', "")
    }

    #[test]
    fn columns_have_names_in_newer_files() {
        let (rows, what) = read(
            "Advanced Telemetry Systems' R4500C Series Receiver-Data Logger,,,,\n\
             Csv Data File: C:\\DCC\\week4.csv,,,,\n Generated: 6/21/2026,,,,\n\
             Program: ATSWinRec_R4500C,Version: R4500C_3.0.27.14133,Source:PC,,,,\n   ,,,,\n\
             Yr,Day,Hr,Mn,Ant,Fr,Sig,Code,NumDet,NumMort,DataInd,Data\n\
             26,172,20,23,1,4305,106,30,21,0,NA,NA\n26,400,20,23,1,4305,106,30,21,0,NA,NA\n\
             26,172,20,33,2,164305,98,12,117,0,NA,NA\n",
        );
        let columns = ["ATS time", "ATS transmitter", "ATS signal", "ATS antenna"];
        assert_eq!(rows.header, columns);
        assert_eq!((rows.lines.as_slice(), rows.broken.len()), ([7, 9].as_slice(), 1));
        assert_eq!(rows.broken[0], (8, "there is no day 400 in the year 26".to_owned()));
        assert_eq!(
            csv(rows),
            "2026-06-21 20:23:00,4305 30,106,f 1\n2026-06-21 20:33:00,164.305 12,98,f 2\n"
        );
        assert!(what.contains("a drone the file and an antenna"), "{what}");
    }

    #[test]
    fn the_number_of_cells_tells_the_columns_of_older_files() {
        let (rows, what) = read(
            "Target Data File: C:\\lake.csv\nGenerated By: ATSWinRec_C v.109;\n\n\n\n\n\n\
             26,172,14,3,5,164305,12,98,48.2009,16.3715,2,\n26,172,14,3,9,NA,NA,NA,48.2,16.3,2,\n\
             26,172,14,3,10,164305,12,99,601983.252,5339533.087,33U,2,\n\
             26,172,14,4,1,164305,12,97,3,\n26,172,14,4,1,164305\n\
             06/21/2026 14:05,1,164305,12,97,3,\nThis file contains 3 Aerial targets\n",
        );
        assert_eq!(rows.header[3..], ["ATS latitude", "ATS longitude"]);
        assert_eq!(rows.lines, [8, 10, 11, 13]);
        assert_eq!(rows.broken, [(12, "6 cells, where a detection has 9, 11 or 12".to_owned())]);
        assert_eq!(
            csv(rows),
            "2026-06-21 14:03:05,164.305 12,98,48.2009,16.3715\n\
             2026-06-21 14:03:10,164.305 12,99,48.2008333,16.3725000\n\
             2026-06-21 14:04:00,164.305 12,97,,\n2026-06-21 14:05:00,164.305 12,97,,\n"
        );
        assert!(what.ends_with("are left out: 1"), "{what}");
    }

    #[test]
    fn others_are_left_alone() {
        for other in ["", "26,172,14,4,1,164305,12,97,3\n"] {
            assert!(convert(other, "f.csv").expect("no error").is_none(), "{other}");
        }
        let places = "Generated By: ATSWinRec_C v.109;\n26,172,14,3,9,NA,NA,NA,48.2,16.3,2,\n";
        let error = convert(places, "f.csv").expect_err("no detection").to_string();
        assert!(error.contains("ATS receiver without a detection"), "{error}");
    }
}
