use rusqlite::{Connection, types::ValueRef};

use super::{
    rows::{Converted, Made, RowsWriter, not_written},
    sqlite::{number, opened, text},
};
use crate::recording::RecordingError;

/// Lines of bearing in a database of df-aggregator (ckoval7/df-aggregator, `database.py`): times in
/// milliseconds since 1970, places of the stations, and directions clockwise from true North.
pub(super) fn convert(bytes: &[u8], file: &str) -> Result<Option<Converted>, RecordingError> {
    let Some(database) = opened(bytes, &["lobs", "intersects"]) else { return Ok(None) };
    read(&database).map(Some).map_err(|error| not_written(file, error))
}

fn read(database: &Connection) -> Result<Converted, Box<dyn std::error::Error + Send + Sync>> {
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
        let made = convert(&bytes, "df.db").expect("it is read").expect("a database");
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
        assert!(convert(b"SQLite format 3\0", "df.db").expect("no error").is_none());
    }
}
