use std::path::{Path, PathBuf};

use rusqlite::{Connection, OpenFlags, OptionalExtension, params};

use super::{Contender, StoreError, StoredCampaign};

/// The mark of a file that is a store: "fxh1".
const APPLICATION: i64 = 0x6678_6831;

/// The format of the tables below.
const FORMAT: i64 = 1;

/// The tables. A run has a row for each beacon of its campaign.
const TABLES: &str = "
CREATE TABLE campaign (
    id INTEGER PRIMARY KEY,
    digest TEXT NOT NULL UNIQUE,
    program TEXT NOT NULL,
    scenario TEXT NOT NULL,
    planner TEXT NOT NULL,
    definition TEXT NOT NULL
) STRICT;
CREATE TABLE beacon (
    campaign INTEGER NOT NULL REFERENCES campaign,
    beacon INTEGER NOT NULL,
    name TEXT NOT NULL,
    PRIMARY KEY (campaign, beacon)
) STRICT, WITHOUT ROWID;
CREATE TABLE contender (
    id INTEGER PRIMARY KEY,
    campaign INTEGER NOT NULL REFERENCES campaign,
    digest TEXT NOT NULL UNIQUE,
    estimator TEXT NOT NULL,
    definition TEXT NOT NULL
) STRICT;
CREATE TABLE run (
    contender INTEGER NOT NULL REFERENCES contender,
    seed INTEGER NOT NULL,
    beacon INTEGER NOT NULL,
    ended TEXT,
    failure TEXT,
    duration_s REAL,
    error_m REAL,
    nees REAL,
    steps INTEGER NOT NULL,
    steps_to_3m INTEGER,
    time_to_3m_s REAL,
    path_m REAL,
    nis_sum REAL NOT NULL,
    nis_sum_of_squares REAL NOT NULL,
    nis_degrees_of_freedom INTEGER NOT NULL,
    nis_count INTEGER NOT NULL,
    PRIMARY KEY (contender, seed, beacon)
) STRICT, WITHOUT ROWID;
CREATE TABLE log (
    contender INTEGER NOT NULL REFERENCES contender,
    seed INTEGER NOT NULL,
    jsonl_gz BLOB NOT NULL,
    PRIMARY KEY (contender, seed)
) STRICT, WITHOUT ROWID;
";

/// A file that holds the runs of campaigns.
///
/// It is a database of SQLite, with a write-ahead log while runs are added: whatever was committed
/// is there after the program was killed, and others may read while one writes.
#[derive(Debug)]
pub struct Store {
    pub(super) connection: Connection,
    path: PathBuf,
}

impl Store {
    /// Opens a store to write to; makes it where there is no such file.
    ///
    /// # Errors
    ///
    /// [`StoreError`] when the file is something else or of another format, or cannot be written.
    pub fn create(path: &Path) -> Result<Self, StoreError> {
        let connection = Connection::open(path).map_err(|source| unopened(path, source))?;
        let store = Self { connection, path: path.to_owned() };
        store.set_up().map_err(|source| unopened(path, source))?;
        store.check()?;
        Ok(store)
    }

    /// Opens a store to read from.
    ///
    /// # Errors
    ///
    /// [`StoreError`] when there is no such file, or it is something else or of another format.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let connection = Connection::open_with_flags(path, flags);
        let connection = connection.map_err(|source| unopened(path, source))?;
        let store = Self { connection, path: path.to_owned() };
        store.check()?;
        Ok(store)
    }

    /// Makes the tables of an empty database, at once or not at all.
    fn set_up(&self) -> Result<(), rusqlite::Error> {
        let connection = &self.connection;
        // Another process may be making the same file: wait for it.
        connection.busy_timeout(std::time::Duration::from_secs(10))?;
        let tables: i64 = connection.query_row("SELECT count(*) FROM sqlite_schema", [], first)?;
        if tables > 0 {
            return Ok(());
        }
        connection.pragma_update(None, "journal_mode", "wal")?;
        connection.execute_batch("BEGIN IMMEDIATE")?;
        let tables: i64 = connection.query_row("SELECT count(*) FROM sqlite_schema", [], first)?;
        if tables == 0 {
            connection.execute_batch(TABLES)?;
            connection.pragma_update(None, "application_id", APPLICATION)?;
            connection.pragma_update(None, "user_version", FORMAT)?;
        }
        connection.execute_batch("COMMIT")
    }

    /// Writes to a log beside the file from now on, so that others may read meanwhile.
    pub(super) fn write_ahead(&self) -> Result<(), StoreError> {
        let set = self.connection.pragma_update(None, "journal_mode", "wal");
        self.doing("setting up", set)
    }

    /// Puts all of it into the one file, which may then be copied, and read on file systems
    /// without shared memory. While others have it open it keeps its log, and is as good.
    pub(super) fn settle(&self) {
        drop(self.connection.pragma_update(None, "journal_mode", "delete"));
    }

    /// Checks that it is a store, and of the format that is known.
    fn check(&self) -> Result<(), StoreError> {
        let pragma = |name| self.connection.pragma_query_value(None, name, first::<i64>);
        match pragma("application_id") {
            Ok(APPLICATION) => {}
            Ok(_) => return Err(StoreError::NotAStore { file: self.file() }),
            Err(source) => return Err(unopened(&self.path, source)),
        }
        let found = self.doing("reading the format", pragma("user_version"))?;
        if found != FORMAT {
            return Err(StoreError::Format { file: self.file(), found, known: FORMAT });
        }
        // A commit survives the end of the program without waiting for the disk at each.
        let set = self.connection.pragma_update(None, "synchronous", "normal");
        self.doing("setting up", set)
    }

    /// The name of the file in errors.
    pub(super) fn file(&self) -> String {
        self.path.display().to_string()
    }

    /// Returns the path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Names the file in an error of SQLite.
    pub(super) fn doing<T>(
        &self,
        doing: &'static str,
        result: Result<T, rusqlite::Error>,
    ) -> Result<T, StoreError> {
        result.map_err(|source| StoreError::Sql { file: self.file(), doing, source })
    }

    /// The campaigns, in the order in which they were begun.
    ///
    /// # Errors
    ///
    /// [`StoreError`] when the file cannot be read.
    pub fn campaigns(&self) -> Result<Vec<StoredCampaign>, StoreError> {
        self.doing("reading the campaigns", self.read_campaigns())
    }

    fn read_campaigns(&self) -> Result<Vec<StoredCampaign>, rusqlite::Error> {
        let mut names = self
            .connection
            .prepare("SELECT name FROM beacon WHERE campaign = ?1 ORDER BY beacon")?;
        let mut campaigns = self.connection.prepare(
            "SELECT id, digest, program, scenario, planner, definition FROM campaign ORDER BY id",
        )?;
        let campaigns = campaigns.query_map([], |row| {
            let id: i64 = row.get(0)?;
            Ok(StoredCampaign {
                id,
                digest: row.get(1)?,
                program: row.get(2)?,
                scenario: row.get(3)?,
                planner: row.get(4)?,
                definition: row.get(5)?,
                beacons: names.query_map([id], first)?.collect::<Result<_, _>>()?,
            })
        })?;
        campaigns.collect()
    }

    /// The contenders of all campaigns, in the order in which they were begun.
    ///
    /// # Errors
    ///
    /// [`StoreError`] when the file cannot be read.
    pub fn contenders(&self) -> Result<Vec<Contender>, StoreError> {
        let read = || {
            let mut contenders = self.connection.prepare(
                "SELECT id, campaign, digest, estimator, definition FROM contender ORDER BY id",
            )?;
            let contenders = contenders.query_map([], |row| {
                Ok(Contender {
                    id: row.get(0)?,
                    campaign: row.get(1)?,
                    digest: row.get(2)?,
                    estimator: row.get(3)?,
                    definition: row.get(4)?,
                })
            })?;
            contenders.collect()
        };
        self.doing("reading the contenders", read())
    }

    /// Finds a campaign by its digest, or adds it; its number in the file.
    pub(super) fn campaign_id(&self, campaign: &StoredCampaign) -> Result<i64, rusqlite::Error> {
        let sql = "SELECT id FROM campaign WHERE digest = ?1";
        let known = self.connection.query_row(sql, [&campaign.digest], first).optional()?;
        if let Some(id) = known {
            return Ok(id);
        }
        let StoredCampaign { digest, program, scenario, planner, definition, beacons, .. } =
            campaign;
        let sql = "INSERT INTO campaign (digest, program, scenario, planner, definition) \
                   VALUES (?1, ?2, ?3, ?4, ?5)";
        self.connection.execute(sql, params![digest, program, scenario, planner, definition])?;
        let id = self.connection.last_insert_rowid();
        for (index, name) in (0_i64..).zip(beacons) {
            let sql = "INSERT INTO beacon (campaign, beacon, name) VALUES (?1, ?2, ?3)";
            self.connection.execute(sql, params![id, index, name])?;
        }
        Ok(id)
    }

    /// Finds a contender by its digest, or adds it; its number in the file.
    pub(super) fn contender_id(&self, contender: &Contender) -> Result<i64, rusqlite::Error> {
        let sql = "SELECT id FROM contender WHERE digest = ?1";
        let known = self.connection.query_row(sql, [&contender.digest], first).optional()?;
        if let Some(id) = known {
            return Ok(id);
        }
        let Contender { campaign, digest, estimator, definition, .. } = contender;
        let sql = "INSERT INTO contender (campaign, digest, estimator, definition) \
                   VALUES (?1, ?2, ?3, ?4)";
        self.connection.execute(sql, params![campaign, digest, estimator, definition])?;
        Ok(self.connection.last_insert_rowid())
    }

    /// Does something in one transaction: all of it, or nothing.
    pub(super) fn at_once<T, E: From<StoreError>>(
        &self,
        work: impl FnOnce() -> Result<T, E>,
    ) -> Result<T, E> {
        let run = |sql| self.doing("writing", self.connection.execute_batch(sql));
        run("BEGIN IMMEDIATE")?;
        let done = work();
        match &done {
            Ok(_) => run("COMMIT")?,
            // What has failed is reported; SQLite may have ended the transaction by itself.
            Err(_) => drop(self.connection.execute_batch("ROLLBACK")),
        }
        done
    }
}

/// The first column of a row.
pub(super) fn first<T: rusqlite::types::FromSql>(
    row: &rusqlite::Row<'_>,
) -> Result<T, rusqlite::Error> {
    row.get(0)
}

/// A file that cannot be opened, or is no database.
fn unopened(path: &Path, source: rusqlite::Error) -> StoreError {
    let file = path.display().to_string();
    match source.sqlite_error_code() {
        Some(rusqlite::ErrorCode::NotADatabase) => StoreError::NotAStore { file },
        _ => StoreError::Sql { file, doing: "opening", source },
    }
}
