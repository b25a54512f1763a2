//! Databases of SQLite in memory.

use std::io::{Cursor, Read};

use rusqlite::{Connection, Row, types::ValueRef};

/// First bytes of a database of SQLite 3.
const MAGIC: &[u8] = b"SQLite format 3\0";

/// Length of a database's header; its bytes 18 and 19 tell how it is written (SQLite, "Database
/// File Format", 1.3).
const HEADER_BYTES: usize = 100;
const WRITTEN: std::ops::Range<usize> = 18..20;

/// The database, if it has all of these tables. Another one, or a damaged one, is named by its own
/// error.
pub(super) fn opened(bytes: &[u8], tables: &[&str]) -> Option<Connection> {
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
pub(super) fn number(row: &Row<'_>, column: usize) -> rusqlite::Result<f64> {
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
pub(super) fn text(row: &Row<'_>, column: usize) -> rusqlite::Result<String> {
    Ok(match row.get_ref(column)? {
        ValueRef::Text(text) => String::from_utf8_lossy(text).into_owned(),
        _ => String::new(),
    })
}
