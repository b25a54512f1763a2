//! Bags of ROS 2: poses and levels out of MCAP (feature `mcap`) and SQLite (feature `sqlite`), as a
//! recording in our own format.

#![cfg_attr(
    not(any(feature = "mcap", feature = "sqlite")),
    expect(dead_code, reason = "what messages hold is of use to the formats of bags alone")
)]

mod contents;
mod join;
mod message;

pub use contents::is_bag;
pub use join::{Converted, Topics, convert};

/// Reason why a bag gave no recording.
#[derive(Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BagError {
    /// The file cannot be read, or is no bag.
    #[error("the bag cannot be read: {reason}")]
    Read {
        /// The reader's message.
        reason: String,
    },
    /// The format is not in this build.
    #[error("{what} is not in this build: build with the feature `{feature}`")]
    NotBuilt {
        /// The format.
        what: &'static str,
        /// The feature that it needs.
        feature: &'static str,
    },
    /// A message is not in CDR.
    #[error("the message encoding is not CDR version 1")]
    Encoding,
    /// A message ends too early for its type.
    #[error("the message ends after {length} bytes, too early for its type")]
    Short {
        /// Length of the message in bytes.
        length: usize,
    },
    /// A message of a topic cannot be read.
    #[error("message {number} of {topic}: {source}")]
    Message {
        /// The topic.
        topic: String,
        /// Number of the message among the messages that are read, from 1.
        number: usize,
        /// The error in the message.
        source: Box<BagError>,
    },
    /// A topic is not in the bag, or of another type.
    #[error("there is no topic{} with {what}; the bag has {known}", after_space(name))]
    NoTopic {
        /// Name of the wanted topic, if one is wanted.
        name: Option<String>,
        /// Wanted contents of the topic.
        what: &'static str,
        /// The topics with their types.
        known: String,
    },
    /// Several topics could be meant.
    #[error("{names} have {what}; choose with {flag}")]
    SeveralTopics {
        /// Names of the topics.
        names: String,
        /// Contents of the topics.
        what: &'static str,
        /// The flag that chooses.
        flag: &'static str,
    },
    /// Nothing came together.
    #[error("none of {levels} levels has a place of the receiver within {gap_s} s on both sides")]
    NoPlaces {
        /// Number of levels.
        levels: usize,
        /// Maximum distance in time between places, in seconds.
        gap_s: f64,
    },
    /// A setting is not a positive number.
    #[error("{name} is {value}; it must be a positive number")]
    Value {
        /// Name of the setting.
        name: &'static str,
        /// Value of the setting.
        value: f64,
    },
}

impl BagError {
    fn read(error: impl std::fmt::Display) -> Self {
        Self::Read { reason: error.to_string() }
    }
}

/// A name behind a space.
fn after_space(name: &Option<String>) -> String {
    name.iter().map(|name| format!(" {name}")).collect()
}
