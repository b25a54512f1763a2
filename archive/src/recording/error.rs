use foxhunt_core::parameter::{FieldError, ParameterError};
use foxhunt_wire::declination::DeclinationError;

use super::{near_miss::slip_for, utc::utc};

/// Error of reading or writing a recording. Every message names the file, and where there is one
/// the line, the column and the value.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// The file cannot be read.
    #[error("{file}: cannot be read")]
    Read {
        /// The file.
        file: String,
        /// The cause.
        source: std::io::Error,
    },
    /// Columns were named of a file whose rows name their own.
    #[error("{file}: its rows name their columns; leave --columns out")]
    NamedColumns {
        /// The file.
        file: String,
    },
    /// A sheet was asked for that the file does not have.
    #[error("{file}: there is no sheet {sheet:?} with two rows{}", its_sheets(.sheets))]
    NoSheet {
        /// The file.
        file: String,
        /// The name of the sheet; empty where no sheet has two rows.
        sheet: String,
        /// The names of the sheets that there are; none of a file that is no spreadsheet.
        sheets: Vec<String>,
    },
    /// The file is not a table.
    #[error("{file}: this is {what}, not a table; {advice}")]
    NotATable {
        /// The file.
        file: String,
        /// Kind of the file.
        what: &'static str,
        /// The command that would work.
        advice: String,
    },
    /// There is no header.
    #[error("{file}: the file is empty; its first line must name the columns")]
    Empty {
        /// The file.
        file: String,
    },
    /// A cell is not UTF-8 text.
    #[error("{file}, line {line}, {column}: {value:?} is not UTF-8 text")]
    NotUtf8 {
        /// The file.
        file: String,
        /// The line, from 1.
        line: u64,
        /// The column.
        column: String,
        /// The cell, with stand-ins for bytes that are not text.
        value: String,
    },
    /// A line of a file of another shape than a table cannot be read.
    #[error("{file}, line {line}: {problem}")]
    Line {
        /// The file.
        file: String,
        /// The line, from 1.
        line: u64,
        /// The reason.
        problem: String,
    },
    /// A row is shorter or longer than the header.
    #[error(
        "{file}, line {line}: {found} fields instead of {expected}, the last one {column}: \
         {value:?}{}", decimal_commas(*found, *expected, value)
    )]
    FieldCount {
        /// The file.
        file: String,
        /// The line, from 1.
        line: u64,
        /// Number of columns that the header names.
        expected: usize,
        /// Number of fields in the row.
        found: usize,
        /// The column of the last field.
        column: String,
        /// The last field.
        value: String,
    },
    /// No known format has such a header.
    #[error(
        "{file}, line {line}: no known format has the columns {header}; the nearest, {nearest}, \
         also needs {}{}; known are {}",
        lacks.join(" and "),
        meant.as_deref().map_or_else(String::new, |[found, name]| slip_for(Some(found), name)),
        known.join(", ")
    )]
    UnknownFormat {
        /// The file.
        file: String,
        /// The header's line, from 1.
        line: u64,
        /// The file's columns.
        header: String,
        /// The format that lacks least.
        nearest: Box<str>,
        /// Columns that the file lacks for it; `a|b` means either.
        lacks: Box<[String]>,
        /// A column of the file, and the lacking one that it may be meant to be.
        meant: Option<Box<[String; 2]>>,
        /// The known formats.
        known: Box<[String]>,
    },
    /// A file of another shape than a table has times and levels without places.
    #[error("{file}: this is {what}, with times and levels, but no places; {advice}")]
    HalfOfKind {
        /// The file.
        file: String,
        /// Kind of the file.
        what: String,
        /// The command that would work.
        advice: String,
    },
    /// A table has times and levels without places, or times and places without levels.
    #[error("{file}, line {line}: the columns {header} hold {held}, but no {missing}; {advice}")]
    Half {
        /// The file.
        file: String,
        /// The header's line, from 1.
        line: u64,
        /// The file's columns.
        header: String,
        /// The part that is there.
        held: &'static str,
        /// The part that is missing.
        missing: &'static str,
        /// The command that would work.
        advice: String,
    },
    /// The table has no header: its first line holds values.
    #[error(
        "{file}, line {line}: the table has no header; its first row is {row}. {}{}",
        naming(file, suggested),
        headerless(formats)
    )]
    NoHeader {
        /// The file.
        file: String,
        /// The first row's line, from 1.
        line: u64,
        /// The first row.
        row: String,
        /// Names that its cells may have, in the form of the flag; empty for a row that is too long
        /// to be named in a command.
        suggested: String,
        /// Formats without a header that have as many columns.
        formats: Box<[String]>,
    },
    /// A column may be a bearing or the direction of the receiver.
    #[error(
        "{file}, line {line}: the column {column:?} may be the bearing to the transmitter or where \
         the receiver's nose looks; call it bearing_deg_compass or heading_deg_compass"
    )]
    Doubtful {
        /// The file.
        file: String,
        /// The header's line, from 1.
        line: u64,
        /// The column.
        column: String,
    },
    /// A time may be read in two ways, and no row shows which is right.
    #[error(
        "{file}, line {line}, {column}: {value:?} may be {}, and no row shows which; state it with \
         --time-format {}", either(readings), readings.iter().map(|[name, _]| *name)
             .collect::<Vec<_>>().join(" or ")
    )]
    AmbiguousTime {
        /// The file.
        file: String,
        /// The line, from 1.
        line: u64,
        /// The column.
        column: String,
        /// The cell.
        value: String,
        /// Names of the formats that fit, each with the cell's meaning.
        readings: &'static [[&'static str; 2]],
    },
    /// There is neither a shipped mapping nor a file of this name.
    #[error("{name:?} is neither a file nor a known format; choose one of {}", known.join(", "))]
    NoSuchFormat {
        /// The name that was given.
        name: String,
        /// The known formats.
        known: Vec<String>,
    },
    /// The file is no mapping; the source names line, field and value.
    #[error("{file}: not a column mapping")]
    Mapping {
        /// The file.
        file: String,
        /// The cause.
        source: Box<toml::de::Error>,
    },
    /// A field of a mapping is out of its range.
    #[error("{file}: {source}")]
    MappingField {
        /// The file.
        file: String,
        /// The field, and the reason.
        source: FieldError,
    },
    /// A column that the format needs is not in the file.
    #[error(
        "{file}, line {line}: the header has no column {column:?}, which the format {format} \
         needs{}", slip_for(meant.as_deref(), column)
    )]
    MissingColumn {
        /// The file.
        file: String,
        /// The header's line, from 1.
        line: u64,
        /// The column.
        column: String,
        /// The format.
        format: String,
        /// The column of the file that may be meant.
        meant: Option<String>,
    },
    /// A column that is used is there more than once.
    #[error("{file}, line {line}: the header names the column {column:?} more than once")]
    DuplicateColumn {
        /// The file.
        file: String,
        /// The header's line, from 1.
        line: u64,
        /// The column.
        column: String,
    },
    /// Columns that must come together do not.
    #[error("{file}, line {line}: {column} needs {needs} beside it")]
    Incomplete {
        /// The file.
        file: String,
        /// The header's line, from 1.
        line: u64,
        /// The column that is there.
        column: String,
        /// The columns that it needs.
        needs: String,
    },
    /// Columns that exclude each other are both there.
    #[error("{file}, line {line}: {column} and {other} exclude each other")]
    Conflict {
        /// The file.
        file: String,
        /// The header's line, from 1.
        line: u64,
        /// One of them.
        column: String,
        /// The other.
        other: String,
    },
    /// A cell is invalid for its column.
    #[error("{file}, line {line}, {column}: {value:?} {problem}")]
    Field {
        /// The file.
        file: String,
        /// The line, from 1.
        line: u64,
        /// The column.
        column: String,
        /// The cell.
        value: String,
        /// The fault of the cell.
        problem: FieldProblem,
    },
    /// A file that holds constants of the recording is not beside it.
    #[error("{file}: recordings of this format keep {column} in {beside} beside them")]
    NothingBeside {
        /// The recording.
        file: String,
        /// The other file.
        beside: String,
        /// A column that is in it.
        column: String,
    },
    /// A file that holds constants has more or less than one row.
    #[error("{file}: {rows} rows instead of the one that holds the recording's constants")]
    NotOneRow {
        /// The file with the constants.
        file: String,
        /// Number of its rows.
        rows: u64,
    },
    /// A file beside a recording has two rows of the same name.
    #[error("{file}, line {line}: {name:?} has a row already, in line {first}")]
    DuplicateRow {
        /// The file.
        file: String,
        /// The second row's line, from 1.
        line: u64,
        /// The name.
        name: String,
        /// The first row's line, from 1.
        first: u64,
    },
    /// A file beside a recording has no row for one of the recording's names.
    #[error("{file}, line {line}: {name:?} has no row in {beside}")]
    NotBeside {
        /// The recording.
        file: String,
        /// The line, from 1.
        line: u64,
        /// The name.
        name: String,
        /// The file beside it, and the name in it that may be meant.
        beside: String,
    },
    /// More than half of the rows cannot be believed.
    #[error("{first}; {bad} of {rows} rows cannot be believed, more than half of the file")]
    MostlyBad {
        /// The error of the first of them.
        first: Box<RecordingError>,
        /// The number of rows that cannot be believed.
        bad: u64,
        /// The number of rows that were read.
        rows: u64,
    },
    /// No row is left.
    #[error("{file}: none of {rows} rows is of use{dropped}")]
    NothingKept {
        /// The file.
        file: String,
        /// Number of its rows.
        rows: u64,
        /// Number of rows that each rule dropped, as text.
        dropped: String,
    },
    /// The file has the power of many frequencies, and no frequency is chosen.
    #[error("{file}: the format {format} holds many frequencies; choose one with --frequency-hz")]
    NoBand {
        /// The file.
        file: String,
        /// The format.
        format: String,
    },
    /// A track is neither GPX nor KML.
    #[error("{file}, line {line}: this is neither GPX nor KML: {problem}")]
    NotGpx {
        /// The file.
        file: String,
        /// The line, from 1.
        line: u64,
        /// The reason.
        problem: String,
    },
    /// A track has no point with place and time.
    #[error("{file}: no point of a track (trkpt) has a time")]
    NoTrack {
        /// The file.
        file: String,
    },
    /// An autopilot's log has no path in UTC.
    #[error("{file}: this is {what}, but {problem}")]
    NoPath {
        /// The file.
        file: String,
        /// Kind of the log.
        what: &'static str,
        /// The missing part.
        problem: String,
    },
    /// A log or a path holds several levels, or not the level that was asked for.
    #[error(
        "{file}: this is {what} {}; {}",
        match named {
            Some(named) => format!("without levels {named:?}"),
            None => "with levels".to_owned(),
        },
        match levels.as_str() {
            "" => "it holds no levels at all, and is a path alone".to_owned(),
            levels => format!("choose them with --level NAME: {levels}"),
        }
    )]
    ChooseLevel {
        /// The file.
        file: String,
        /// Kind of the log.
        what: &'static str,
        /// The name that was asked for.
        named: Option<String>,
        /// The names that there are, in a log each with its number of levels; empty without levels.
        levels: String,
    },
    /// A recording and the track of its receiver have no time in common.
    #[error(
        "{file}: its times, from {} to {} UTC, are not those of the track {track}, from {} to {} \
         UTC; they begin {:.0} s {} it. State how many seconds are to be added to the recording's \
         times with --clock-offset-s S, or --tz where they are local time",
        utc(times[0]), utc(times[1]), utc(track_times[0]), utc(track_times[1]),
        (times[0] - track_times[0]).abs(),
        if times[0] < track_times[0] { "before" } else { "after" }
    )]
    NoCommonTime {
        /// The recording.
        file: String,
        /// First and last time of the recording, in seconds since 1970.
        times: [f64; 2],
        /// The track.
        track: String,
        /// First and last time of the track, in seconds since 1970.
        track_times: [f64; 2],
    },
    /// Files in local metres and files in degrees do not share a frame.
    #[error("{file} is in local metres and {other} in degrees; a frame must be given for both")]
    MixedFrames {
        /// The file in metres.
        file: String,
        /// The file in degrees.
        other: String,
    },
    /// A parameter of the reading is out of its range.
    #[error("{file}: {source}")]
    Parameter {
        /// The file.
        file: String,
        /// The parameter, and the reason.
        source: ParameterError,
    },
    /// A name cannot be written so that it reads back the same.
    #[error("the {column} name {value:?} is empty or has spaces around it")]
    Name {
        /// Column of the name.
        column: &'static str,
        /// The name.
        value: String,
    },
    /// A sample cannot be written.
    #[error("sample {index} has the {field} {value}, which cannot be read back")]
    Sample {
        /// Index of the sample in the sweep.
        index: usize,
        /// The field.
        field: &'static str,
        /// Value of the field.
        value: f64,
    },
    /// The recording cannot be written.
    #[error("the recording cannot be written")]
    Write {
        /// The cause.
        source: std::io::Error,
    },
}

/// Fault of a cell.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FieldProblem {
    /// It must be a number.
    #[error("is not a number")]
    NotANumber,
    /// It must be a number of seconds.
    #[error("is a date, not a number of seconds; call the column time_utc or time")]
    Date,
    /// It is NaN, infinite or too large.
    #[error("is not a finite number")]
    NotFinite,
    /// It must be a whole number.
    #[error("is not a whole number from 0 to {max}")]
    NotWhole {
        /// The greatest.
        max: f64,
    },
    /// It is out of range.
    #[error("is not between {min} and {max}")]
    OutOfRange {
        /// The least.
        min: f64,
        /// The greatest.
        max: f64,
    },
    /// It would be a power that no receiver survives, and is usual without its sign.
    #[error(
        "is not between {min} and {max}; levels without their sign are read with --negate-levels"
    )]
    Unsigned {
        /// The least.
        min: f64,
        /// The greatest.
        max: f64,
    },
    /// It stands for no reading.
    #[error("stands for no reading: every other level is {apart_db:.0} dB away or more")]
    NoReading {
        /// Distance of the next level, in dB.
        apart_db: f64,
    },
    /// It would be a longitude.
    #[error("is not a latitude; latitude and longitude look swapped")]
    Swapped,
    /// It must be a latitude or longitude.
    #[error("is neither degrees nor degrees, minutes and seconds")]
    NotDegrees,
    /// The hemisphere is that of the other coordinate.
    #[error(
        "has the hemisphere of the other coordinate; N and S are latitudes, E and W longitudes"
    )]
    OtherHemisphere,
    /// It must be a latitude and a longitude, a place of UTM or a grid reference.
    #[error("is not a place such as 48.2, 16.37 or 33U 601983 5339533 or 33U XP 01983 39533")]
    NotAPair,
    /// O stands for East in some languages and for West in others.
    #[error("may be East (Ost) or West (oeste, ouest); write E or W")]
    EastOrWest,
    /// It must be a zone of UTM with its hemisphere.
    #[error("{0}")]
    NotAZone(&'static str),
    /// It must be a date and time.
    #[error("is not a time such as YYYY-MM-DD HH:MM:SS or DD.MM.YYYY HH:MM")]
    NotATime,
    /// It must not be empty.
    #[error("must not be empty here")]
    Missing,
    /// The quote at the beginning is not closed.
    #[error("begins with a quote that is not closed")]
    Unclosed,
    /// The mapping's lookup does not list it.
    #[error("is not among the values that the mapping knows")]
    NotInLookup,
    /// It is where receivers without a fix report to be.
    #[error("is where a receiver without a fix reports to be")]
    NoFix,
    /// The row is earlier than the one before.
    #[error("is {by_s} s earlier than the row before, and times must rise")]
    Backwards {
        /// The difference, in seconds.
        by_s: f64,
    },
    /// The time is out of order: the receiver's clock was set.
    #[error("is {by_s} s out of order in a format whose times rise")]
    OutOfOrder {
        /// The difference from the rows about it, in seconds.
        by_s: f64,
    },
    /// The receiver cannot have moved there.
    #[error("is {distance_m:.0} m from the row about it, {within_s} s apart, too far to move")]
    Jump {
        /// The distance, in metres.
        distance_m: f64,
        /// The time between the two rows, in seconds.
        within_s: f64,
    },
    /// The row is a copy.
    #[error("begins a row that is the same as line {line}")]
    Copy {
        /// The line of the first such row, from 1.
        line: u64,
    },
    /// It cannot be measured with such a standard deviation.
    #[error("is not a measurement")]
    NotAMeasurement,
    /// It is counted from magnetic or grid North, and the place on Earth is not known.
    #[error(
        "is counted from a North that depends on the place, and the recording has no places in \
         degrees; state by how many degrees it is east of true North"
    )]
    NoPlace,
    /// It is counted from magnetic North, and the day is not known.
    #[error(
        "is counted from magnetic North, which depends on the day, and the recording has no \
         time_utc; give the day with --date YYYY-MM-DD"
    )]
    NoDate,
    /// It is counted from magnetic North, which is not known there and then.
    #[error("is counted from magnetic North: {0}")]
    NoDeclination(DeclinationError),
    /// Heights are counted from the ground.
    #[error("has heights above the ground; export the track with absolute heights")]
    AboveGround,
    /// It is not near the frame's origin.
    #[error("is {distance_km:.0} km from the frame's origin; at most {limit_km} km make sense")]
    TooFar {
        /// The distance, in kilometres.
        distance_km: f64,
        /// The limit, in kilometres.
        limit_km: f64,
    },
    /// It is far from the frame's origin, and would be near it the other way round.
    #[error(
        "is {distance_km:.0} km from the frame's origin; latitude and longitude look swapped, here \
         or in the first row"
    )]
    SwappedPlace {
        /// The distance, in kilometres.
        distance_km: f64,
    },
}

/// A file as an argument of a command.
pub(super) fn argument(file: &str) -> &str {
    if file == "standard input" { "-" } else { file }
}

/// The end of a message about a row of too many fields: whole numbers at its end may be what was
/// behind a comma.
fn decimal_commas(found: usize, expected: usize, last: &str) -> &'static str {
    let is_whole = !last.is_empty() && last.bytes().all(|byte| byte.is_ascii_digit());
    if found > expected && is_whole {
        "; numbers with a decimal comma need quotes, or semicolons between the columns"
    } else {
        ""
    }
}

/// The way in which the columns of a table without a header are named.
fn naming(file: &str, suggested: &str) -> String {
    if suggested.is_empty() {
        return "Name its columns in a mapping, with names = [...], and give it with --format"
            .to_owned();
    }
    let file = argument(file);
    let is_placed = ["lat", "x"].iter().any(|name| suggested.split(',').any(|of| of == *name));
    let [path, meaning] = match is_placed {
        true => [""; 2],
        false => [" PATH", "; PATH is a file with the receiver's path"],
    };
    format!(
        "Name its columns, in this order, such as foxhunt locate {file}{path} --columns \
         {suggested} (- for a column that is not to be read{meaning})"
    )
}

/// The end of a message about a table without a header.
fn headerless(formats: &[String]) -> String {
    if formats.is_empty() {
        return String::new();
    }
    format!("; or, for what a program wrote, --format {}", formats.join(" or --format "))
}

/// The readings of a time, for people.
fn either(readings: &[[&str; 2]]) -> String {
    readings.iter().map(|[_, meaning]| *meaning).collect::<Vec<_>>().join(" or ")
}

/// The end of a message about a sheet that is not there.
fn its_sheets(sheets: &[String]) -> String {
    match sheets {
        [] => "; it is no spreadsheet that this build reads".to_owned(),
        sheets => format!("; its sheets: {}", sheets.join(", ")),
    }
}
