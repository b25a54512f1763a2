//! Built-in formats, the mapping that fits a table, and names for the columns of one without a
//! header.

use std::{borrow::Cow, fs, path::Path, sync::LazyLock};

use super::{
    Column, Mapping, ReadOptions, RecordingError, Source,
    dates::{clock_seconds, is_date, is_day},
    error::argument,
    near_miss::near_miss,
    plain::{self, Half},
    table::{Table, shown},
};

/// Our own format first: it is preferred where two fit equally well.
const TEXTS: [&str; 34] = [
    include_str!("../../formats/foxhunt.toml"),
    include_str!("../../formats/aerpaw-afar.toml"),
    include_str!("../../formats/aerpaw-tower.toml"),
    include_str!("../../formats/airdata.toml"),
    include_str!("../../formats/airdata-metric.toml"),
    include_str!("../../formats/ats.toml"),
    include_str!("../../formats/chasemapper.toml"),
    include_str!("../../formats/chirpstack.toml"),
    include_str!("../../formats/chirpstack3.toml"),
    include_str!("../../formats/ctt.toml"),
    include_str!("../../formats/dji.toml"),
    include_str!("../../formats/dji-metric.toml"),
    include_str!("../../formats/dji-log-parser.toml"),
    include_str!("../../formats/dji-txtlog.toml"),
    include_str!("../../formats/espresense.toml"),
    include_str!("../../formats/hackrf-sweep.toml"),
    include_str!("../../formats/krakensdr.toml"),
    include_str!("../../formats/krakensdr-json.toml"),
    include_str!("../../formats/lenth1981.toml"),
    include_str!("../../formats/lotek-srx1200.toml"),
    include_str!("../../formats/meshtastic.toml"),
    include_str!("../../formats/motus.toml"),
    include_str!("../../formats/movebank.toml"),
    include_str!("../../formats/otter-telemetry.toml"),
    include_str!("../../formats/qgroundcontrol.toml"),
    include_str!("../../formats/rssi-distance.toml"),
    include_str!("../../formats/rtl-power.toml"),
    include_str!("../../formats/sigloc.toml"),
    include_str!("../../formats/tinygs.toml"),
    include_str!("../../formats/tinygs-mqtt.toml"),
    include_str!("../../formats/ttn.toml"),
    include_str!("../../formats/uavrt-rotation.toml"),
    include_str!("../../formats/ucsd-collars.toml"),
    include_str!("../../formats/uri-yagi-station.toml"),
];

static SHIPPED: LazyLock<Vec<Mapping>> = LazyLock::new(|| {
    let parse = |text| Mapping::parse(text, "formats").expect("a test parses every one of them");
    TEXTS.into_iter().map(parse).collect()
});

/// The mappings that come with the library, our own format first.
#[must_use]
pub fn builtin_mappings() -> &'static [Mapping] {
    &SHIPPED
}

impl Mapping {
    /// The mapping of a shipped name, or else of a TOML file.
    ///
    /// # Errors
    ///
    /// [`RecordingError`] names the file, the line and the field, or lists the shipped names.
    pub fn find(name_or_path: &str) -> Result<Self, RecordingError> {
        if let Some(shipped) = builtin_mappings().iter().find(|m| m.name == name_or_path) {
            return Ok(shipped.clone());
        }
        if !Path::new(name_or_path).exists() {
            let name = name_or_path.to_owned();
            return Err(RecordingError::NoSuchFormat { name, known: known() });
        }
        let text = fs::read_to_string(name_or_path)
            .map_err(|source| RecordingError::Read { file: name_or_path.to_owned(), source })?;
        Self::parse(&text, name_or_path)
    }
}

/// The shipped formats' names.
fn known() -> Vec<String> {
    SHIPPED.iter().map(|mapping| mapping.name.clone()).collect()
}

/// Columns that are named in a command at most.
const MOST_NAMED: usize = 16;

/// The format without a header that its rows show, with the cells by which they do.
const ROWS: [(&str, [(usize, &str); 4]); 1] =
    [("krakensdr", [(13, "R"), (14, "R"), (15, "R"), (16, "R")])];

/// The shipped format without a header that a row is of; `None` if a name must be given.
pub(super) fn headerless(row: &[String]) -> Option<&'static Mapping> {
    let is = |(index, text): &(usize, &str)| row.get(*index).is_some_and(|cell| cell == text);
    let (name, _) = ROWS.iter().find(|(_, cells)| cells.iter().all(is))?;
    SHIPPED.iter().find(|mapping| mapping.name == *name)
}

/// Returns true if a shipped mapping's header fits a line, or its columns have common names.
/// With a track the table needs no places, with a stated level no measurements.
pub(super) fn is_known(columns: &[String], options: &ReadOptions) -> bool {
    let mut with_header = SHIPPED.iter().filter(|mapping| !mapping.header.is_empty());
    with_header.any(|mapping| mapping.lacks(columns).is_empty())
        || plain::is_plain(columns, options)
}

/// Returns the shipped mapping whose header fits a file's columns; of several, the mapping with the
/// longest header. A table whose columns have common names gets a mapping of its own, by the cells
/// of its first row.
pub(super) fn recognise(
    table: &Table<'_>,
    options: &ReadOptions,
    first: impl Fn(&str) -> Option<String>,
) -> Result<Cow<'static, Mapping>, RecordingError> {
    let file = table.file();
    let line = table.header_line();
    let columns = table.header();
    let is_row_of = |mapping: &&Mapping| !mapping.names.is_empty() && mapping.names == columns;
    if let Some(headerless) = SHIPPED.iter().find(is_row_of) {
        return Ok(Cow::Borrowed(headerless));
    }
    let with_header = || SHIPPED.iter().filter(|mapping| !mapping.header.is_empty());
    let fits = with_header().filter(|mapping| mapping.lacks(columns).is_empty());
    // `rev`, for of equals the last one would win.
    let fits: Vec<_> = fits.collect();
    let best = fits.into_iter().rev().max_by_key(|mapping| mapping.header.len());
    if let Some(level) = &options.level {
        let is_path = |mapping: &&Mapping| mapping.path;
        let path = match best.filter(is_path) {
            Some(path) => Some(path.clone()),
            None => plain::mapping(table, options, first)?,
        };
        return with_level(path, table, level).map(Cow::Owned);
    }
    if let Some(best) = best {
        if best.path && !plain::has_stated_level(options) {
            return Err(path_alone(table));
        }
        return Ok(Cow::Borrowed(best));
    }
    if let Some(plain) = plain::mapping(table, options, first)? {
        return Ok(Cow::Owned(plain));
    }
    // Words between spaces, where nothing else separates the cells.
    let words: Vec<String> = match columns {
        [line] => line.split_whitespace().map(str::to_owned).collect(),
        _ => Vec::new(),
    };
    let cells = if words.is_empty() { columns } else { &words };
    if is_row(cells) {
        let has = |mapping: &&Mapping| {
            let fixed = mapping.names.len();
            fixed > 0 && columns.len() >= fixed
        };
        return Err(RecordingError::NoHeader {
            file: file.to_owned(),
            line,
            row: shown(&cells.join(", ")),
            suggested: if cells.len() <= MOST_NAMED {
                names(cells).join(",")
            } else {
                String::new()
            },
            formats: SHIPPED.iter().filter(has).map(|m| m.name.clone()).collect(),
        });
    }
    let nearest = with_header().min_by_key(|mapping| {
        let lacks = mapping.lacks(columns);
        // In thousandths of what it needs, so that short headers are not always the nearest.
        lacks.len() * 1000 / mapping.header.len().max(1)
    });
    let lacks: Box<[String]> = nearest.map(|m| m.lacks(columns)).unwrap_or_default().into();
    let meant = lacks.iter().flat_map(|entry| entry.split('|')).find_map(|name| {
        let found = near_miss(name, columns.iter().map(String::as_str))?;
        Some(Box::new([found.to_owned(), name.to_owned()]))
    });
    let slip =
        plain::slip(columns).map(|[found, meant]| format!("is {found:?} meant to be {meant:?}?"));
    // Otherwise a slip in a name of ours is the likelier reason.
    let half = plain::half(columns).filter(|_| slip.is_some() || meant.is_none());
    match half {
        Some(Half::Path) => return Err(path_alone(table)),
        Some(Half::Measurements) => {
            let named = match options.columns.as_slice() {
                [] => String::new(),
                names => format!(" --columns {}", names.join(",")),
            };
            let beside = format!(
                "give the receiver's path beside it, as GPX, a table with times and places or a \
                 log of ArduPilot, PX4 or MAVLink: foxhunt locate {} PATH{named}",
                argument(file)
            );
            return Err(RecordingError::Half {
                file: file.to_owned(),
                line,
                header: shown(&columns.join(", ")),
                held: "times and levels or bearings",
                missing: "places",
                advice: slip.unwrap_or(beside),
            });
        }
        None => {}
    }
    Err(RecordingError::UnknownFormat {
        file: file.to_owned(),
        line,
        header: columns.join(", "),
        nearest: nearest.map(|m| m.name.as_str()).unwrap_or_default().into(),
        lacks,
        meant,
        known: known().into(),
    })
}

/// A path's mapping with a column of levels.
pub(super) fn with_level(
    path: Option<Mapping>,
    table: &Table<'_>,
    level: &str,
) -> Result<Mapping, RecordingError> {
    let column = table.header().iter().find(|name| name.eq_ignore_ascii_case(level));
    let (Some(mut path), Some(column)) = (path, column) else {
        return Err(RecordingError::ChooseLevel {
            file: table.file().to_owned(),
            what: "a table",
            named: Some(level.to_owned()),
            levels: plain::levels(table.header()),
        });
    };
    path.columns.retain(|column, _| ![Column::RssDb, Column::RssDbm].contains(column));
    path.columns.insert(plain::level_column(column), Source::column(column));
    Ok(path)
}

/// The question whether a column is a slip for what half of a table lacks.
fn slip(columns: &[String]) -> Option<String> {
    let [found, meant] = plain::slip(columns)?;
    Some(format!("is {found:?} meant to be {meant:?}?"))
}

/// The error that a table is a path alone, with the levels that may be read of it, or the slip that
/// may be the reason.
fn path_alone(table: &Table<'_>) -> RecordingError {
    let file = table.file().to_owned();
    let levels = plain::levels(table.header());
    if !levels.is_empty() {
        let what = "a receiver's path";
        return RecordingError::ChooseLevel { file, what, named: None, levels };
    }
    let alone = format!(
        "call the column of levels rssi, or give the file as the path of others: foxhunt locate \
         LEVELS.csv {}",
        argument(&file)
    );
    RecordingError::Half {
        line: table.header_line(),
        header: shown(&table.header().join(", ")),
        held: "times and places",
        missing: "levels and no bearings",
        advice: slip(table.header()).unwrap_or(alone),
        file,
    }
}

/// Returns true for the begin of a table that holds a receiver's path: its header names times and
/// places, and no levels or bearings, or is of a format of paths.
pub(super) fn is_path(begin: &[u8]) -> bool {
    // Without the line that is cut, but for a header alone.
    let end = begin.iter().rposition(|byte| *byte == b'\n').unwrap_or(begin.len());
    let begin = begin.get(..end).unwrap_or(begin);
    if begin.contains(&0) || begin.starts_with(b"<") {
        return false;
    }
    let fits_path = |header: &[String]| {
        let mut paths = SHIPPED.iter().filter(|mapping| mapping.path);
        paths.any(|mapping| mapping.lacks(header).is_empty())
    };
    let options = ReadOptions::default();
    let is_header = |header: &[String]| is_known(header, &options) || plain::is_path(header);
    let table = Table::open_fitting("", begin, None, is_header);
    table.is_ok_and(|table| {
        let header = table.header();
        fits_path(header) || (plain::is_path(header) && !is_known(header, &options))
    })
}

/// Least number of decimals of a place in degrees: 100 m.
const DECIMALS: usize = 3;

/// Returns true if a line holds values instead of names: at least half of its cells are numbers or
/// times, and no fewer than two.
fn is_row(cells: &[String]) -> bool {
    let filled = cells.iter().filter(|cell| !cell.is_empty()).count();
    let is_value = |cell: &&String| number(cell).is_some() || is_time(cell) || is_day(cell);
    let values = cells.iter().filter(is_value).count();
    values >= 2 && 2 * values >= filled
}

/// Names that the cells of a row may have, as an example for who knows them: `-` for a cell that
/// may be anything.
fn names(cells: &[String]) -> Vec<&'static str> {
    let mut names: Vec<&'static str> = cells.iter().map(|_| "-").collect();
    let mut set = |index: usize, name: &'static str| {
        let is_new = !names.contains(&name);
        if let Some(place) = names.get_mut(index).filter(|place| **place == "-" && is_new) {
            *place = name;
        }
    };
    let within = |cell: &str, limit: f64| number(cell).is_some_and(|value| value.abs() <= limit);
    let is_place = |lat: &str, lon: &str| {
        decimals(lat) >= DECIMALS
            && decimals(lon) >= DECIMALS
            && within(lat, 90.0)
            && within(lon, 360.0)
    };
    let pair = |is: &dyn Fn(&str, &str) -> bool| {
        cells.windows(2).position(|pair| matches!(pair, [first, second] if is(first, second)))
    };
    if let Some(first) = pair(&is_place) {
        set(first, "lat");
        set(first + 1, "lon");
    }
    for (index, cell) in cells.iter().enumerate() {
        match number(cell) {
            _ if is_time(cell) => set(index, "time"),
            _ if is_day(cell) => set(index, "date"),
            Some(value) if value >= 1e8 => set(index, "time"),
            Some(value) if (-160.0..-9.0).contains(&value) => set(index, "rssi"),
            _ => {}
        }
    }
    let last = cells.len().saturating_sub(1);
    let is_angle = cells.last().and_then(|cell| number(cell));
    if is_angle.is_some_and(|value| (0.0..=360.0).contains(&value)) {
        set(last, "bearing");
    }
    // Without degrees the first two numbers may be metres.
    let in_metres = !names.contains(&"lat");
    let free = |[a, b]: [&&str; 2]| *a == "-" && *b == "-";
    let first = names.windows(2).position(|pair| matches!(pair, [a, b] if free([a, b])));
    if let Some(first) = first.filter(|_| in_metres) {
        for (index, name) in [(first, "x"), (first + 1, "y")] {
            if let Some(place) = names.get_mut(index) {
                *place = name;
            }
        }
    }
    names
}

fn number(cell: &str) -> Option<f64> {
    cell.replace(',', ".").parse().ok().filter(|value: &f64| value.is_finite())
}

fn decimals(cell: &str) -> usize {
    cell.split_once(['.', ',']).map_or(0, |(_, decimals)| decimals.len())
}

fn is_time(cell: &str) -> bool {
    is_date(cell) || clock_seconds(cell).is_some()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::recording::Column;

    #[test]
    fn every_shipped_mapping_is_one() {
        let names: BTreeSet<_> = known().into_iter().collect();
        assert_eq!(names.len(), TEXTS.len(), "names are unique");
        for mapping in builtin_mappings() {
            assert!(!mapping.description.is_empty());
        }
    }

    #[test]
    fn of_several_that_fit_the_one_that_needs_most_is_taken() {
        let named = |header: &str| {
            let table = Table::open("f.csv", header.as_bytes(), None, &[]).expect("a header");
            recognise(&table, &ReadOptions::default(), |_| None)
                .map(|mapping| mapping.name.clone())
                .ok()
        };
        assert_eq!(named("rss_dbm,range_m").as_deref(), Some("foxhunt"));
        let both = named("rss_dbm,range_m,obs,x,y,bearing_deg");
        assert_eq!(both.as_deref(), Some("lenth1981"));
        let (uavrt, yagis) = (
            "tag_id,snr_db,group,idx_in_group,yaw_deg",
            "time,antenna,rssi_dbm,tag_lat_deg,tag_lon_deg",
        );
        // Both need five columns: the first in the list.
        let both = named(&format!("{yagis},{uavrt}"));
        assert_eq!(both.as_deref(), Some("uavrt-rotation"));
        assert_eq!(named(yagis).as_deref(), Some("uri-yagi-station"));
    }

    #[test]
    fn our_format_has_every_column_under_its_own_name() {
        let ours = &builtin_mappings()[0];
        assert_eq!(ours.name, "foxhunt");
        assert!(Column::ALL.into_iter().eq(ours.columns.keys().copied()));
        for (column, source) in &ours.columns {
            assert_eq!(source.columns, [column.name()]);
            assert!(source.optional, "{column}");
        }
    }

    fn cells(row: &str) -> Vec<String> {
        row.split(';').map(str::to_owned).collect()
    }

    #[test]
    fn rows_are_told_from_headers() {
        for row in [
            "50.1;14.2;45",
            "fox;50,1;14,2;45",
            "2026-06-21 14:03:00;50.1",
            "14:03;-71",
            "2026-06-21;14:03;fox",
        ] {
            assert!(is_row(&cells(row)), "{row}");
        }
        for header in ["lat;lon;bearing", "a;b;c;1;2", "2026", ""] {
            assert!(!is_row(&cells(header)), "{header}");
        }
    }

    #[test]
    fn names_are_an_example() {
        for (row, expected) in [
            ("50.0755;14.4378;45", "lat,lon,bearing"),
            ("2026-06-21 14:03:00;50,0755;14,4378;-71", "time,lat,lon,rssi"),
            ("0;100;315", "x,y,bearing"),
            ("2026-06-21;14:03:00;-71", "date,time,rssi"),
            ("1782050580;50.0755;14.4378;fox;-71;3", "time,lat,lon,-,rssi,bearing"),
        ] {
            assert_eq!(names(&cells(row)).join(","), expected, "{row}");
        }
    }
}
