use std::io;

use crate::{ThreadsError, simulation::SimulationError};

/// The reason why a store cannot be written, read or put together.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// SQLite refuses.
    #[error("{file}: {doing} failed")]
    Sql {
        /// The file.
        file: String,
        /// The action that failed.
        doing: &'static str,
        /// The cause.
        source: rusqlite::Error,
    },
    /// The file is something else.
    #[error("{file} is not a store of campaigns")]
    NotAStore {
        /// The file.
        file: String,
    },
    /// The file was written by another version of the program.
    #[error("{file} is a store of format {found}; this program reads format {known}")]
    Format {
        /// The file.
        file: String,
        /// Format of the file.
        found: i64,
        /// Format that this program reads.
        known: i64,
    },
    /// A row does not hold what it must.
    #[error("{file}: contender {contender}, seed {seed}, beacon {beacon}: {field} {requirement}")]
    Row {
        /// The file.
        file: String,
        /// The number of the contender.
        contender: i64,
        /// The seed of the run.
        seed: i64,
        /// The index of the beacon.
        beacon: i64,
        /// The column.
        field: &'static str,
        /// The requirement on the value.
        requirement: &'static str,
    },
    /// A scenario or an estimator cannot be written as text.
    #[error("what defines the campaign cannot be written as TOML")]
    Definition(#[from] toml::ser::Error),
    /// A scenario without beacons has nothing to keep.
    #[error("the scenario {scenario} has no beacon, so that there is nothing to keep")]
    NoBeacon {
        /// Name of the scenario.
        scenario: String,
    },
    /// Seeds are kept as 64 bits with a sign.
    #[error("a store holds seeds below 2^63; {runs} runs from seed {seed} exceed them")]
    Seeds {
        /// The first one.
        seed: u64,
        /// The number of runs.
        runs: u32,
    },
    /// Two stores are not of the same campaign.
    #[error("{second} belongs to another campaign than {first}: {what}")]
    Other {
        /// The store that was taken first.
        first: String,
        /// The store that differs.
        second: String,
        /// The difference, with the value of each.
        what: String,
    },
    /// Two stores have the same run with other results.
    #[error("{second} has other results than {first} for {estimator}, seed {seed}")]
    Contradiction {
        /// The store that was taken first.
        first: String,
        /// The store that differs.
        second: String,
        /// The contender.
        estimator: String,
        /// The seed.
        seed: i64,
    },
    /// A contender that is compared is not there, or not the only one of its name.
    #[error("{file}: {name:?} names {count} contenders; there are {}", known.join(", "))]
    Contender {
        /// The file.
        file: String,
        /// The name that was given.
        name: String,
        /// The number of contenders with that name.
        count: usize,
        /// The contenders that there are.
        known: Vec<String>,
    },
    /// There is no log of a run.
    #[error("{file} has no log of {contender} with seed {seed}")]
    NoLog {
        /// The file.
        file: String,
        /// The contender.
        contender: String,
        /// The seed.
        seed: u64,
    },
    /// A file cannot be written or read.
    #[error("{file}: {doing} failed")]
    Io {
        /// The file.
        file: String,
        /// The action that failed.
        doing: &'static str,
        /// The cause.
        source: io::Error,
    },
    /// The threads could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
    /// A hunt could not be built.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
}
