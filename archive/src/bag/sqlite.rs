use std::path::Path;

use rusqlite::{Connection, OpenFlags, Result};

use super::{
    contents::{Bag, Message, Topic},
    message::Kind,
};

/// The messages of a bag's file as `rosbag2_storage_sqlite3` writes it.
pub(super) fn read(path: &Path) -> Result<Bag> {
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
