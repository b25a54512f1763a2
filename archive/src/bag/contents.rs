//! Contents of a bag, and their readers.

use std::{fs, io, path::Path};

#[cfg(feature = "mcap")]
use mcap::MessageStream;
#[cfg(feature = "sqlite")]
use rusqlite::{Connection, OpenFlags};

use super::{BagError, message::Kind};

/// A message out of a bag.
pub(super) struct Message {
    /// Index of the bag's topic.
    pub topic: usize,
    /// Time of recording in nanoseconds, in most bags since 1970.
    pub time_ns: i64,
    /// The message in CDR.
    pub data: Vec<u8>,
}

/// A topic of a bag.
#[derive(Debug)]
pub(super) struct Topic {
    pub name: String,
    /// The name of its type.
    of: String,
    /// Kind of its messages, if they are read.
    pub kind: Option<Kind>,
}

/// The messages of a bag whose kind is read, in the order of time.
pub(super) struct Bag {
    pub topics: Vec<Topic>,
    pub messages: Vec<Message>,
}

impl Bag {
    /// The topics with their types, as errors name them.
    pub(super) fn known(&self) -> String {
        let known = self.topics.iter().map(|topic| format!("{} ({})", topic.name, topic.of));
        let known: Vec<String> = known.collect();
        if known.is_empty() { "none".to_owned() } else { known.join(", ") }
    }
}

/// Returns true if a file is a bag: MCAP, or SQLite by its first bytes.
///
/// # Errors
///
/// An error when the file cannot be read.
pub fn is_bag(path: &Path) -> io::Result<bool> {
    use io::Read as _;

    let mut first = Vec::new();
    fs::File::open(path)?.take(16).read_to_end(&mut first)?;
    Ok(first.starts_with(b"\x89MCAP0\r\n") || first.starts_with(b"SQLite format 3\0"))
}

impl Bag {
    pub(super) fn open(path: &Path) -> Result<Self, BagError> {
        let mut bag = match path.extension().is_some_and(|ending| ending == "db3") {
            true => Self::of_sqlite(path)?,
            false => Self::of_mcap(path)?,
        };
        bag.messages.sort_by_key(|message| message.time_ns);
        Ok(bag)
    }

    #[cfg(feature = "mcap")]
    fn of_mcap(path: &Path) -> Result<Self, BagError> {
        read_mcap(&fs::read(path).map_err(BagError::read)?)
    }

    #[cfg(not(feature = "mcap"))]
    fn of_mcap(_: &Path) -> Result<Self, BagError> {
        Err(BagError::NotBuilt { what: "MCAP", feature: "mcap" })
    }

    #[cfg(feature = "sqlite")]
    fn of_sqlite(path: &Path) -> Result<Self, BagError> {
        read_sqlite(path).map_err(BagError::read)
    }

    #[cfg(not(feature = "sqlite"))]
    fn of_sqlite(_: &Path) -> Result<Self, BagError> {
        Err(BagError::NotBuilt { what: "a bag in SQLite", feature: "store" })
    }
}

/// The messages of an MCAP file.
#[cfg(feature = "mcap")]
fn read_mcap(bytes: &[u8]) -> Result<Bag, BagError> {
    let mut bag = Bag { topics: Vec::new(), messages: Vec::new() };
    for message in MessageStream::new(bytes).map_err(BagError::read)? {
        let message = message.map_err(BagError::read)?;
        let channel = &message.channel;
        let known = bag.topics.iter().position(|topic| topic.name == channel.topic);
        let topic = known.unwrap_or_else(|| {
            let of = channel.schema.as_ref().map_or_else(String::new, |s| s.name.clone());
            let kind = Kind::named(&of).filter(|_| channel.message_encoding == "cdr");
            bag.topics.push(Topic { name: channel.topic.clone(), of, kind });
            bag.topics.len() - 1
        });
        if bag.topics.get(topic).is_some_and(|topic| topic.kind.is_some()) {
            let time_ns = i64::try_from(message.log_time).unwrap_or(i64::MAX);
            bag.messages.push(Message { topic, time_ns, data: message.data.into_owned() });
        }
    }
    Ok(bag)
}

/// The messages of a bag's file as `rosbag2_storage_sqlite3` writes it.
#[cfg(feature = "sqlite")]
fn read_sqlite(path: &Path) -> rusqlite::Result<Bag> {
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let file = Connection::open_with_flags(path, flags)?;
    let mut bag = Bag { topics: Vec::new(), messages: Vec::new() };
    let mut numbers = Vec::new();
    let mut topics = file.prepare("SELECT id, name, type, serialization_format FROM topics")?;
    let mut rows = topics.query([])?;
    while let Some(row) = rows.next()? {
        let (of, format): (String, String) = (row.get(2)?, row.get(3)?);
        let kind = Kind::named(&of).filter(|_| format == "cdr");
        numbers.push(row.get::<_, i64>(0)?);
        bag.topics.push(Topic { name: row.get(1)?, of, kind });
    }
    let mut messages = file.prepare("SELECT topic_id, timestamp, data FROM messages")?;
    let mut rows = messages.query([])?;
    while let Some(row) = rows.next()? {
        let number: i64 = row.get(0)?;
        let Some(topic) = numbers.iter().position(|known| *known == number) else { continue };
        if bag.topics.get(topic).is_some_and(|topic| topic.kind.is_some()) {
            bag.messages.push(Message { topic, time_ns: row.get(1)?, data: row.get(2)? });
        }
    }
    Ok(bag)
}

#[cfg(all(test, feature = "mcap"))]
mod tests {
    use std::collections::BTreeMap;

    use mcap::{Writer, records::MessageHeader};

    use crate::bag::{BagError, Topics, convert};

    /// A message in CDR whose header has the frame `map`, and these numbers after it.
    fn stamped(numbers: &[f64]) -> Vec<u8> {
        let mut bytes = vec![0, 0, 0, 0, 0, 0, 0, 0, 4, 0, 0, 0];
        bytes.extend(*b"map\0");
        bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        [&[0, 1, 0, 0][..], &bytes].concat()
    }

    /// A bag of poses that go East at 2 m/s, and levels a quarter of a second after each.
    fn bag(topics: &[&str]) -> Vec<u8> {
        let mut writer = Writer::new(std::io::Cursor::new(Vec::new())).expect("a writer");
        let mut channels = Vec::new();
        for topic in topics {
            let of = if topic.contains("pose") {
                "geometry_msgs/msg/PoseStamped"
            } else {
                "std_msgs/msg/Float32"
            };
            let schema = writer.add_schema(of, "ros2msg", b"").expect("a schema");
            let channel = writer.add_channel(schema, topic, "cdr", &BTreeMap::new());
            channels.push((channel.expect("a channel"), topic.contains("pose")));
        }
        for second in 0..5_u8 {
            for (channel_id, is_pose) in &channels {
                let east = 2.0 * f64::from(second);
                let level =
                    [&[0, 1, 0, 0], &(-50.0 - f32::from(second)).to_le_bytes()[..]].concat();
                let (late, data) = match is_pose {
                    true => (0, stamped(&[east, 7.0, 4.0, 0.0, 0.0, 0.0, 1.0])),
                    false => (250_000_000, level),
                };
                let time = u64::from(second) * 1_000_000_000 + late;
                let header = MessageHeader {
                    channel_id: *channel_id,
                    sequence: u32::from(second),
                    log_time: time,
                    publish_time: time,
                };
                writer.write_to_known_channel(&header, &data).expect("a message");
            }
        }
        writer.finish().expect("its end");
        writer.into_inner().into_inner()
    }

    fn converted(topics: &[&str], wanted: &Topics) -> Result<String, BagError> {
        let name = format!("foxhunt-{}-{}.mcap", std::process::id(), topics.join("").len());
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, bag(topics)).expect("a file");
        let mut out = Vec::new();
        let converted = convert(&path, wanted, &mut out);
        std::fs::remove_file(&path).expect("it was ours");
        converted.map(|_| String::from_utf8(out).expect("UTF-8"))
    }

    #[test]
    fn levels_are_put_where_the_receiver_was() {
        let text = converted(&["/pose", "/rssi"], &Topics::default()).expect("it is converted");
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "time_s,rss_dbm,east_m,north_m,up_m,heading_deg_compass");
        // The last level has no pose after it.
        assert_eq!(lines.len(), 5, "{text}");
        assert_eq!(lines[1], "0.25,-50,0.5,7,4,90");
        assert_eq!(lines[4], "3.25,-53,6.5,7,4,90");
        let few = Topics { gap_s: 0.9, ..Topics::default() };
        let none = converted(&["/pose", "/rssi"], &few);
        assert_eq!(none, Err(BagError::NoPlaces { levels: 5, gap_s: 0.9 }));
    }

    #[test]
    fn topics_are_chosen_and_named() {
        let several = ["/pose", "/rssi", "/rssi2"];
        let Err(BagError::SeveralTopics { names, flag, .. }) =
            converted(&several, &Topics::default())
        else {
            panic!("two have levels")
        };
        assert_eq!((names.as_str(), flag), ("/rssi, /rssi2", "--rssi-topic"));
        let levels = vec![("/rssi2".to_owned(), Some("fox".to_owned()))];
        let named = converted(&several, &Topics { levels, ..Topics::default() });
        assert!(named.is_ok_and(|text| text.contains(",fox\n")));
        let pose = Some("/rssi".to_owned());
        let wrong = converted(&several, &Topics { pose, ..Topics::default() });
        assert!(
            matches!(wrong, Err(BagError::NoTopic { name: Some(name), .. }) if name == "/rssi")
        );
    }
}
