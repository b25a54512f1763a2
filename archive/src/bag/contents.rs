use super::message::Kind;

/// A message out of a bag.
pub(super) struct Message {
    /// Index of the bag's topic.
    pub(super) topic: usize,
    /// Time of recording in nanoseconds, in most bags since 1970.
    pub(super) time_ns: i64,
    /// The message in CDR.
    pub(super) data: Vec<u8>,
}

/// A topic of a bag.
#[derive(Debug)]
pub(super) struct Topic {
    pub(super) name: String,
    /// The name of its type.
    pub(super) of: String,
    /// Kind of its messages, if they are read.
    pub(super) kind: Option<Kind>,
}

/// The messages of a bag whose kind is read, in the order of time.
pub(super) struct Bag {
    pub(super) topics: Vec<Topic>,
    pub(super) messages: Vec<Message>,
}

impl Bag {
    /// The topics with their types, as errors name them.
    pub(super) fn known(&self) -> String {
        let known = self.topics.iter().map(|topic| format!("{} ({})", topic.name, topic.of));
        let known: Vec<String> = known.collect();
        if known.is_empty() { "none".to_owned() } else { known.join(", ") }
    }
}
