//! Campaigns in a file: every run of every contender is kept in SQLite as it ends, so that a
//! campaign that was killed goes on, and parts of one that ran elsewhere are put together.
//!
//! A [`Store`] holds campaigns (a scenario as it is flown, a planner, a version of the program),
//! their contenders (an estimator with its settings) and for each of these the runs by seed, one
//! row for each beacon. Campaigns and contenders are known again by the SHA-256 of the text that
//! defines them, which is kept beside it.
//!
//! Summaries go over the rows in the order of the seeds through the same running figures as
//! [`campaign`](crate::campaign::campaign)'s, so that both agree to the last digit, however often
//! a campaign was broken off and on however many computers it ran.

mod error;
mod export;
mod fly;
mod merge;
mod read;

pub use error::StoreError;
pub use export::write_csv;
pub use fly::{CampaignToStore, Shard, ShardError};
pub use merge::merge;
pub use read::{Filter, Held, Row, SeedBySeed, Summary, compare};

#[cfg(feature = "parquet")]
pub use export::write_parquet;

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
};

use foxhunt_hunt::{
    config::EstimatorConfig, document, registry::EstimatorEntry, scenario::Scenario,
};
use rusqlite::{Connection, OpenFlags, OptionalExtension, params};
use serde::Serialize;

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
    connection: Connection,
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
    fn write_ahead(&self) -> Result<(), StoreError> {
        let set = self.connection.pragma_update(None, "journal_mode", "wal");
        self.doing("setting up", set)
    }

    /// Puts all of it into the one file, which may then be copied, and read on file systems
    /// without shared memory. While others have it open it keeps its log, and is as good.
    fn settle(&self) {
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
    fn file(&self) -> String {
        self.path.display().to_string()
    }

    /// Returns the path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Names the file in an error of SQLite.
    fn doing<T>(
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
    fn campaign_id(&self, campaign: &StoredCampaign) -> Result<i64, rusqlite::Error> {
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
    fn contender_id(&self, contender: &Contender) -> Result<i64, rusqlite::Error> {
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
    fn at_once<T, E: From<StoreError>>(&self, work: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
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

/// A campaign as it stands in a store: what all of its contenders have in common.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct StoredCampaign {
    /// Number of the campaign in the file.
    #[serde(skip)]
    pub id: i64,
    /// The SHA-256 of its definition, in hexadecimal digits.
    pub digest: String,
    /// The program that flew it, and its version.
    pub program: String,
    /// The scenario's name.
    pub scenario: String,
    /// The planner's name, or that it is the scenario's own.
    pub planner: String,
    /// Definition of the campaign, as TOML: program, planner and the scenario as it was flown.
    #[serde(skip)]
    pub definition: String,
    /// The names of the beacons, in their order.
    pub beacons: Vec<String>,
}

/// An estimator that a campaign compares.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Contender {
    /// Number of the contender in the file.
    #[serde(skip)]
    pub id: i64,
    /// The number of its campaign.
    #[serde(skip)]
    pub campaign: i64,
    /// The SHA-256 of the campaign's digest and its own definition, in hexadecimal digits.
    pub digest: String,
    /// The estimator's name.
    pub estimator: String,
    /// Definition of the contender, as TOML: name and settings of the estimator.
    #[serde(skip)]
    pub definition: String,
}

#[derive(Serialize)]
struct CampaignText<'a> {
    program: &'a str,
    planner: &'a str,
    scenario: &'a Scenario,
}

#[derive(Serialize)]
struct ContenderText<'a> {
    estimator: &'a str,
    /// Absent for code of a user's own, which is known by its name alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    settings: Option<&'a EstimatorConfig>,
}

impl StoredCampaign {
    fn new(
        program: &str,
        planner: &str,
        scenario: &Scenario,
        beacons: Vec<String>,
    ) -> Result<Self, StoreError> {
        let definition = document::to_toml(&CampaignText { program, planner, scenario })?;
        Ok(Self {
            id: 0,
            digest: digest(&[&definition]),
            program: program.to_owned(),
            scenario: scenario.name.clone(),
            planner: planner.to_owned(),
            definition,
            beacons,
        })
    }
}

impl Contender {
    fn new(campaign: &StoredCampaign, estimator: &EstimatorEntry) -> Result<Self, StoreError> {
        let text = ContenderText { estimator: &estimator.name, settings: estimator.settings() };
        let definition = document::to_toml(&text)?;
        Ok(Self {
            id: 0,
            campaign: campaign.id,
            digest: digest(&[&campaign.digest, "\n", &definition]),
            estimator: estimator.name.clone().into_owned(),
            definition,
        })
    }

    /// Returns the contender's name, with the beginning of its digest: `ekf@1a2b3c4d`.
    #[must_use]
    pub fn full_name(&self) -> String {
        let digest = self.digest.get(..8).unwrap_or(&self.digest);
        format!("{}@{digest}", self.estimator)
    }

    /// Returns true if this is its name, with or without the beginning of its digest.
    #[must_use]
    pub fn is(&self, name: &str) -> bool {
        match name.rsplit_once('@') {
            Some((estimator, digest)) if !digest.is_empty() => {
                estimator == self.estimator && self.digest.starts_with(digest)
            }
            _ => name == self.estimator,
        }
    }
}

/// The first column of a row.
fn first<T: rusqlite::types::FromSql>(row: &rusqlite::Row<'_>) -> Result<T, rusqlite::Error> {
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

/// The SHA-256 of texts one after the other, in hexadecimal digits.
fn digest(texts: &[&str]) -> String {
    let mut hash = hmac_sha256::Hash::new();
    texts.iter().for_each(|text| hash.update(text));
    hash.finalize().iter().fold(String::new(), |mut digits, byte| {
        // Writing to a string does not fail.
        let _ = write!(digits, "{byte:02x}");
        digits
    })
}

#[cfg(test)]
mod tests {
    use foxhunt_hunt::registry::Registry;

    use super::*;

    #[test]
    fn digests_are_those_of_the_standard() {
        // FIPS 180-4: "abc".
        let known = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(digest(&["a", "bc"]), known);
    }

    #[test]
    fn whatever_changes_a_run_changes_the_digest() {
        let scenario = Scenario::find("pritzl-6.1").expect("it is built in");
        let of = |program: &str, planner: &str, scenario: &Scenario| {
            StoredCampaign::new(program, planner, scenario, Vec::new()).expect("plain fields")
        };
        let campaign = of("foxhunt 1", "own", &scenario);
        assert_eq!(campaign, of("foxhunt 1", "own", &scenario.clone()));
        let mut other = scenario.clone();
        other.world.channel.sample_sigma_db += 1e-9;
        let others = [
            of("foxhunt 2", "own", &scenario),
            of("foxhunt 1", "hold", &scenario),
            of("foxhunt 1", "own", &other),
        ];
        assert!(others.iter().all(|other| other.digest != campaign.digest));
        // The scenario may be flown again from its text.
        let text: toml::Table = campaign.definition.parse().expect("TOML");
        let text = toml::to_string(&text["scenario"]).expect("TOML");
        assert_eq!(Scenario::parse(&text, "kept").expect("in order"), scenario);

        let registry = Registry::builtin();
        let ekf = registry.estimator("ekf").expect("it is built in");
        let wide = ekf.with_settings("prior", |settings| settings.prior_sigma_m = Some(9.0));
        let of = |entry: &EstimatorEntry| Contender::new(&campaign, entry).expect("plain fields");
        let ekf = of(ekf);
        let wide = of(&wide.expect("it has settings"));
        assert_ne!(ekf.digest, wide.digest);
        assert!(ekf.is("ekf") && wide.is("ekf") && ekf.is(&ekf.full_name()));
        assert!(!wide.is(&ekf.full_name()) && !ekf.is("ukf") && !ekf.is("ekf@"));
    }
}
