use rusqlite::{Connection, types::ValueRef};

use super::{
    rows::{Converted, Made, RowsWriter, not_written},
    sqlite::{number, opened, text},
};
use crate::recording::RecordingError;

/// Version of the log before which places are whole numbers, degrees times 100,000, and have no
/// height.
const DEGREES_SINCE: i64 = 5;

/// Packets of a log of Kismet (`.kismet`, "KismetDB logs"): their level, place and sender.
pub(super) fn convert(bytes: &[u8], file: &str) -> Result<Option<Converted>, RecordingError> {
    let Some(database) = opened(bytes, &["packets", "KISMET"]) else { return Ok(None) };
    read(&database).map(Some).map_err(|error| not_written(file, error))
}

fn read(database: &Connection) -> Result<Converted, Box<dyn std::error::Error + Send + Sync>> {
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
        let made = convert(&bytes, "old.kismet").expect("it is read").expect("a log");
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
        assert!(convert(b"SQLite format 3\0", "walk.db").expect("no error").is_none());
    }
}
