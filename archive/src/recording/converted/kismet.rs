use std::io::Cursor;

use rusqlite::{Connection, Row, types::ValueRef};

use super::{Converted, Made, RowsWriter, not_written};
use crate::recording::RecordingError;

/// First bytes of a database of SQLite 3.
const MAGIC: &[u8] = b"SQLite format 3\0";

/// Version of the log before which places are whole numbers, degrees times 100,000.
const DEGREES_SINCE: i64 = 5;

/// Packets of a log of Kismet (`.kismet`, "KismetDB logs"): their level, place and sender.
pub(super) fn convert(bytes: &[u8], file: &str) -> Result<Option<Converted>, RecordingError> {
    // Another database, or a damaged one, is named by its own error.
    let Some(database) = opened(bytes) else { return Ok(None) };
    read(&database).map(Some).map_err(|error| not_written(file, error))
}

/// The database, if it has the tables of Kismet.
fn opened(bytes: &[u8]) -> Option<Connection> {
    let is_database = bytes.starts_with(MAGIC);
    let mut database = is_database.then(|| Connection::open_in_memory().ok()).flatten()?;
    database.deserialize_read_exact("main", Cursor::new(bytes), bytes.len(), true).ok()?;
    let found = "SELECT count(*) FROM sqlite_master \
                 WHERE type = 'table' AND name IN ('packets', 'KISMET')";
    let tables: i64 = database.query_row(found, [], |row| row.get(0)).ok()?;
    (tables == 2).then_some(database)
}

fn read(database: &Connection) -> Result<Converted, Box<dyn std::error::Error + Send + Sync>> {
    let version = "SELECT db_version FROM KISMET";
    let version: i64 = database.query_row(version, [], |row| row.get(0))?;
    let scale = if version < DEGREES_SINCE { 1e-5 } else { 1.0 };
    let header = ["time_utc", "beacon", "drone", "rss_dbm", "lat_deg", "lon_deg", "alt_m"];
    let mut made = RowsWriter::new(&header);
    let mut packets = database.prepare(
        "SELECT ts_sec, ts_usec, sourcemac, datasource, signal, lat, lon, alt FROM packets \
         WHERE signal <> 0 AND (lat <> 0 OR lon <> 0) ORDER BY ts_sec, ts_usec",
    )?;
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
            number(row, 7)?.to_string(),
        ];
        made.write(line, &cells)?;
    }
    let what =
        format!("a log of Kismet; packets with a level and a place are the rows, {line} of {all}");
    Ok(Converted { table: Made::Rows(made.finish()?), what })
}

/// A cell as a number: Kismet's columns hold whole numbers, others or texts by its version.
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

fn text(row: &Row<'_>, column: usize) -> rusqlite::Result<String> {
    Ok(match row.get_ref(column)? {
        ValueRef::Text(text) => String::from_utf8_lossy(text).into_owned(),
        _ => String::new(),
    })
}
