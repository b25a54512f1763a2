//! Bags of ROS 2: poses and levels out of MCAP (feature `mcap`) and SQLite (feature `sqlite`), as a
//! recording in our own format.

#![cfg_attr(
    not(any(feature = "mcap", feature = "sqlite")),
    expect(dead_code, reason = "what messages hold is of use to the formats of bags alone")
)]

mod cdr;
mod join;
#[cfg(feature = "mcap")]
mod mcap;
mod message;
#[cfg(feature = "sqlite")]
mod sqlite;

use std::{fs, io, path::Path};

pub use self::join::{Converted, Topics, convert};
use self::message::Kind;

/// A message out of a bag.
struct Message {
    /// Which of the bag's topics.
    topic: usize,
    /// When it was recorded, in nanoseconds, in most bags since 1970.
    time_ns: i64,
    /// The message in CDR.
    data: Vec<u8>,
}

/// A topic of a bag.
#[derive(Debug)]
struct Topic {
    name: String,
    /// The name of its type.
    of: String,
    /// What is read of it, if anything.
    kind: Option<Kind>,
}

/// The messages of a bag whose kind is read, in the order of time.
struct Bag {
    topics: Vec<Topic>,
    messages: Vec<Message>,
}

/// Why a bag gave no recording.
#[derive(Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BagError {
    /// The file cannot be read, or is no bag.
    #[error("the bag cannot be read: {reason}")]
    Read {
        /// Why.
        reason: String,
    },
    /// The format is not in this build.
    #[error("{what} is not in this build: build with the feature `{feature}`")]
    NotBuilt {
        /// Which format.
        what: &'static str,
        /// What it needs.
        feature: &'static str,
    },
    /// A message is not in CDR.
    #[error("it is not in CDR, version 1")]
    Encoding,
    /// A message ends too early for its type.
    #[error("it ends after {length} bytes, too early for its type")]
    Short {
        /// How many bytes it has.
        length: usize,
    },
    /// A message of a topic cannot be read.
    #[error("message {number} of {topic}: {source}")]
    Message {
        /// The topic.
        topic: String,
        /// The number of the message among those that are read, from 1.
        number: usize,
        /// What is wrong.
        source: Box<BagError>,
    },
    /// A topic is not in the bag, or of another type.
    #[error("there is no topic {name} with {what}; the bag has {known}")]
    NoTopic {
        /// What was wanted.
        name: String,
        /// What it should hold.
        what: &'static str,
        /// The topics with their types.
        known: String,
    },
    /// Several topics could be meant.
    #[error("{names} have {what}; choose with {flag}")]
    SeveralTopics {
        /// Which.
        names: String,
        /// What they hold.
        what: &'static str,
        /// The flag that chooses.
        flag: &'static str,
    },
    /// Nothing came together.
    #[error("none of {levels} levels has a place of the receiver within {gap_s} s on both sides")]
    NoPlaces {
        /// How many levels there are.
        levels: usize,
        /// How far places may be apart, in seconds.
        gap_s: f64,
    },
    /// A value is none.
    #[error("{name} is {value}; it must be a positive number")]
    Value {
        /// Of what.
        name: &'static str,
        /// What it is.
        value: f64,
    },
}

impl BagError {
    fn read(error: impl std::fmt::Display) -> Self {
        Self::Read { reason: error.to_string() }
    }
}

/// Whether a file is a bag: MCAP, or SQLite by its first bytes.
///
/// # Errors
///
/// The error of the file.
pub fn is_bag(path: &Path) -> io::Result<bool> {
    use io::Read as _;

    let mut first = Vec::new();
    fs::File::open(path)?.take(16).read_to_end(&mut first)?;
    Ok(first.starts_with(b"\x89MCAP0\r\n") || first.starts_with(b"SQLite format 3\0"))
}

impl Bag {
    fn open(path: &Path) -> Result<Self, BagError> {
        let mut bag = match path.extension().is_some_and(|ending| ending == "db3") {
            true => Self::of_sqlite(path)?,
            false => Self::of_mcap(path)?,
        };
        bag.messages.sort_by_key(|message| message.time_ns);
        Ok(bag)
    }

    #[cfg(feature = "mcap")]
    fn of_mcap(path: &Path) -> Result<Self, BagError> {
        mcap::read(&fs::read(path).map_err(BagError::read)?)
    }

    #[cfg(not(feature = "mcap"))]
    fn of_mcap(_: &Path) -> Result<Self, BagError> {
        Err(BagError::NotBuilt { what: "MCAP", feature: "mcap" })
    }

    #[cfg(feature = "sqlite")]
    fn of_sqlite(path: &Path) -> Result<Self, BagError> {
        sqlite::read(path).map_err(BagError::read)
    }

    #[cfg(not(feature = "sqlite"))]
    fn of_sqlite(_: &Path) -> Result<Self, BagError> {
        Err(BagError::NotBuilt { what: "a bag in SQLite", feature: "store" })
    }

    /// The topics with their types, as errors name them.
    fn known(&self) -> String {
        let known = self.topics.iter().map(|topic| format!("{} ({})", topic.name, topic.of));
        let known: Vec<String> = known.collect();
        if known.is_empty() { "none".to_owned() } else { known.join(", ") }
    }
}
