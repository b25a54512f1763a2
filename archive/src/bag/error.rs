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
    /// A setting is not a positive number.
    #[error("{name} is {value}; it must be a positive number")]
    Value {
        /// Of what.
        name: &'static str,
        /// What it is.
        value: f64,
    },
}

impl BagError {
    pub(super) fn read(error: impl std::fmt::Display) -> Self {
        Self::Read { reason: error.to_string() }
    }
}
