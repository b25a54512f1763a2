//! Databases of SQLite in memory: recordings of Kismet and of DF Aggregator.

use std::io::{Cursor, Read};

use rusqlite::{Connection, Row, types::ValueRef};

use super::rows::{Converted, Made, RowsWriter, not_written};
use crate::recording::RecordingError;

/// First bytes of a database of SQLite 3.
const MAGIC: &[u8] = b"SQLite format 3\0";

/// Length of a database's header; its bytes 18 and 19 tell how it is written (SQLite, "Database
/// File Format", 1.3).
const HEADER_BYTES: usize = 100;
const WRITTEN: std::ops::Range<usize> = 18..20;

/// The database, if it has all of these tables. Another one, or a damaged one, is named by its own
/// error.
fn opened(bytes: &[u8], tables: &[&str]) -> Option<Connection> {
    let (header, rest) = bytes.split_at_checked(HEADER_BYTES)?;
    if !header.starts_with(MAGIC) {
        return None;
    }
    // A log for writing ahead is no part of the file, and one that needs it is not opened.
    let mut header = header.to_vec();
    header.get_mut(WRITTEN)?.fill(1);
    let whole = Cursor::new(header).chain(rest);
    let mut database = Connection::open_in_memory().ok()?;
    database.deserialize_read_exact("main", whole, bytes.len(), true).ok()?;
    for table in tables {
        let found = "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name = ?1";
        let count: i64 = database.query_row(found, [table], |row| row.get(0)).ok()?;
        if count != 1 {
            return None;
        }
    }
    Some(database)
}

/// A cell as a number, whatever it is written as; 0 where it holds none.
fn number(row: &Row<'_>, column: usize) -> rusqlite::Result<f64> {
    Ok(match row.get_ref(column)? {
        #[expect(clippy::cast_precision_loss, reason = "seconds and levels are far below 2^53")]
        ValueRef::Integer(whole) => whole as f64,
        ValueRef::Real(real) => real,
        ValueRef::Text(text) => {
            std::str::from_utf8(text).ok().and_then(|t| t.parse().ok()).unwrap_or(0.0)
        }
        ValueRef::Null | ValueRef::Blob(_) => 0.0,
    })
}

/// A cell as a text; empty where it holds none.
fn text(row: &Row<'_>, column: usize) -> rusqlite::Result<String> {
    Ok(match row.get_ref(column)? {
        ValueRef::Text(text) => String::from_utf8_lossy(text).into_owned(),
        _ => String::new(),
    })
}

/// Lines of bearing in a database of df-aggregator (ckoval7/df-aggregator, `database.py`): times in
/// milliseconds since 1970, places of the stations, and directions clockwise from true North.
pub(super) fn convert_df_aggregator(
    bytes: &[u8],
    file: &str,
) -> Result<Option<Converted>, RecordingError> {
    let Some(database) = opened(bytes, &["lobs", "intersects"]) else { return Ok(None) };
    read_df_aggregator(&database).map(Some).map_err(|error| not_written(file, error))
}

fn read_df_aggregator(
    database: &Connection,
) -> Result<Converted, Box<dyn std::error::Error + Send + Sync>> {
    // Older versions have neither power nor frequency.
    let has = |column: &str| {
        let found = "SELECT count(*) FROM pragma_table_info('lobs') WHERE name = ?1";
        database.query_row(found, [column], |row| row.get::<_, i64>(0)).map(|count| count > 0)
    };
    let or_null = |column: &'static str| Ok(if has(column)? { column } else { "NULL" });
    let power: Result<_, rusqlite::Error> = or_null("power");
    let frequency: Result<_, rusqlite::Error> = or_null("frequency");
    let mut lines = database.prepare(&format!(
        "SELECT time, station_id, latitude, longitude, lob, {}, {} FROM lobs \
         WHERE latitude <> 0 OR longitude <> 0 ORDER BY time",
        power?, frequency?
    ))?;
    let all: i64 = database.query_row("SELECT count(*) FROM lobs", [], |row| row.get(0))?;
    let header =
        ["time_utc", "drone", "lat_deg", "lon_deg", "bearing_deg_compass", "rss_db", "beacon"];
    let mut made = RowsWriter::new(&header);
    let mut rows = lines.query([])?;
    let mut line = 0;
    while let Some(row) = rows.next()? {
        line += 1;
        let known = |column| -> rusqlite::Result<String> {
            Ok(match row.get_ref(column)? {
                ValueRef::Null => String::new(),
                _ => number(row, column)?.to_string(),
            })
        };
        let cells = [
            format!("{:.3}", 1e-3 * number(row, 0)?),
            text(row, 1)?,
            known(2)?,
            known(3)?,
            known(4)?,
            known(5)?,
            known(6)?,
        ];
        made.write(line, &cells)?;
    }
    let what = format!(
        "a database of df-aggregator; lines of bearing with a station's place are the rows, {line} \
         of {all}, and a beacon is a frequency"
    );
    Ok(Converted { table: Made::Rows(made.finish()?), what })
}

/// Version of the log before which places are whole numbers, degrees times 100,000, and have no
/// height.
const DEGREES_SINCE: i64 = 5;

/// Packets of a log of Kismet (`.kismet`, "KismetDB logs"): their level, place and sender.
pub(super) fn convert_kismet(
    bytes: &[u8],
    file: &str,
) -> Result<Option<Converted>, RecordingError> {
    let Some(database) = opened(bytes, &["packets", "KISMET"]) else { return Ok(None) };
    read_kismet(&database).map(Some).map_err(|error| not_written(file, error))
}

fn read_kismet(
    database: &Connection,
) -> Result<Converted, Box<dyn std::error::Error + Send + Sync>> {
    let version = "SELECT db_version FROM KISMET";
    let version: i64 = database.query_row(version, [], |row| row.get(0))?;
    let (scale, height) = if version < DEGREES_SINCE { (1e-5, "NULL") } else { (1.0, "alt") };
    let header = ["time_utc", "beacon", "drone", "rss_dbm", "lat_deg", "lon_deg", "alt_m"];
    let mut made = RowsWriter::new(&header);
    let mut packets = database.prepare(&format!(
        "SELECT ts_sec, ts_usec, sourcemac, datasource, signal, lat, lon, {height} FROM packets \
         WHERE signal <> 0 AND (lat <> 0 OR lon <> 0) ORDER BY ts_sec, ts_usec",
    ))?;
    let all: i64 = database.query_row("SELECT count(*) FROM packets", [], |row| row.get(0))?;
    let mut rows = packets.query([])?;
    let mut line = 0;
    while let Some(row) = rows.next()? {
        line += 1;
        let time = number(row, 0)? + 1e-6 * number(row, 1)?;
        let cells = [
            format!("{time:.6}"),
            text(row, 2)?,
            text(row, 3)?,
            number(row, 4)?.to_string(),
            (scale * number(row, 5)?).to_string(),
            (scale * number(row, 6)?).to_string(),
            match row.get_ref(7)? {
                ValueRef::Null => String::new(),
                _ => number(row, 7)?.to_string(),
            },
        ];
        made.write(line, &cells)?;
    }
    let what =
        format!("a log of Kismet; packets with a level and a place are the rows, {line} of {all}");
    Ok(Converted { table: Made::Rows(made.finish()?), what })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(schema: &str, lines: &str) -> (Vec<String>, String) {
        let mut database = Connection::open_in_memory().expect("in memory");
        let intersects = "CREATE TABLE intersects (id INTEGER, time INTEGER, latitude REAL)";
        database.execute_batch(&format!("{intersects}; {schema}; {lines}")).expect("SQL");
        let mut bytes = database.serialize("main").expect("in memory").to_vec();
        // As in a file that is written ahead.
        bytes[18..20].fill(2);
        let made = convert_df_aggregator(&bytes, "df.db").expect("it is read").expect("a database");
        let Made::Rows(rows) = made.table else { panic!("rows") };
        let csv = String::from_utf8(rows.csv).expect("text").replace('"', "");
        (csv.lines().map(str::to_owned).collect(), made.what)
    }

    #[test]
    fn lines_of_bearing_are_rows() {
        let (rows, what) = rows(
            "CREATE TABLE lobs (id INTEGER PRIMARY KEY AUTOINCREMENT, time INTEGER, \
             station_id TEXT, latitude REAL, longitude REAL, confidence INTEGER, power REAL, \
             frequency REAL, lob REAL)",
            "INSERT INTO lobs VALUES (NULL, 1782050581250, 'car', 48.2, 16.37, 90, -31.5, 433.92, \
             271.5); \
             INSERT INTO lobs VALUES (NULL, 1782050580000, 'hill', 48.3, 16, 9, NULL, 433.92, 0); \
             INSERT INTO lobs VALUES (NULL, 1782050582000, 'car', 0, 0, 90, -30, 433.92, 10);",
        );
        assert_eq!(
            rows,
            [
                "1782050580.000,hill,48.3,16,0,,433.92",
                "1782050581.250,car,48.2,16.37,271.5,-31.5,433.92"
            ]
        );
        assert!(what.contains("2 of 3"), "{what}");
    }

    #[test]
    fn older_databases_have_bearings_alone() {
        let (rows, _) = rows(
            "CREATE TABLE lobs (time INTEGER, station_id TEXT, latitude REAL, longitude REAL, \
             confidence INTEGER, lob REAL)",
            "INSERT INTO lobs VALUES (1613000000000, 'a', 48.2, 16.37, 90, 45);",
        );
        assert_eq!(rows, ["1613000000.000,a,48.2,16.37,45,,"]);
        assert!(convert_df_aggregator(b"SQLite format 3\0", "df.db").expect("no error").is_none());
    }

    /// Places of version 4 are degrees times 100,000, and have no height.
    #[test]
    fn logs_of_before_version_5_have_whole_places() {
        let mut log = Connection::open_in_memory().expect("in memory");
        log.execute_batch(
            "CREATE TABLE KISMET (kismet_version TEXT, db_version INT); \
             INSERT INTO KISMET VALUES ('2018', 4); \
             CREATE TABLE packets (ts_sec INT, ts_usec INT, sourcemac TEXT, lat INT, lon INT, \
                                   signal INT, datasource TEXT); \
             INSERT INTO packets VALUES (1529589780, 250000, '02:00', 4820000, 1637000, -61, 'a');",
        )
        .expect("SQL");
        let bytes = log.serialize("main").expect("in memory").to_vec();
        let made = convert_kismet(&bytes, "old.kismet").expect("it is read").expect("a log");
        let Made::Rows(rows) = made.table else { panic!("rows") };
        let text = String::from_utf8(rows.csv).expect("text").replace('"', "");
        assert_eq!(
            text.split(',').collect::<Vec<_>>()[..4],
            ["1529589780.250000", "02:00", "a", "-61"]
        );
        let place: Vec<f64> =
            text.split(',').skip(4).take(2).map(|cell| cell.parse().expect("a number")).collect();
        assert!((place[0] - 48.2).abs() < 1e-9 && (place[1] - 16.37).abs() < 1e-9, "{text}");
        assert!(text.ends_with(",\n"), "{text}");
        assert!(convert_kismet(b"SQLite format 3\0", "walk.db").expect("no error").is_none());
    }
}
