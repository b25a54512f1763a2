use std::collections::BTreeMap;

use serde_json::{Deserializer, Map, Value};

use super::rows::{Rows, RowsWriter, not_written};
use crate::recording::RecordingError;

/// Maximum number of columns; further keys are not read.
const MOST_COLUMNS: usize = 500;

/// A list with more entries than this is not read: it holds samples, not columns.
const MOST_ENTRIES: usize = 8;

/// Lists of receivers that heard one transmission, of which each becomes a row: `ChirpStack`, The
/// Things Stack.
const RECEIVERS: [&str; 2] = ["rxInfo", "rx_metadata"];

/// Reads JSON lines, a list of objects, or objects one after the other, each as a row with nested
/// keys joined by dots; `None` for a file that does not begin as any of these. A line may begin
/// with the topic of a message.
pub(super) fn convert(bytes: &[u8], file: &str) -> Result<Option<Rows>, RecordingError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if !is_json(bytes) {
        return Ok(None);
    }
    let mut json = RowsWriter::new(&[]);
    let mut columns = BTreeMap::new();
    let mut at = 0;
    let mut line = 1;
    while let Some(rest) = bytes.get(at..).filter(|rest| !rest.is_empty()) {
        let between = |byte: &&u8| byte.is_ascii_whitespace() || b",[]".contains(byte);
        let skipped = rest.iter().take_while(between).count();
        let (before, rest) = rest.split_at(skipped);
        line += newlines(before);
        at += skipped;
        if rest.is_empty() {
            break;
        }
        let topic = topic(rest);
        let begin = topic.map_or(0, str::len);
        let text = rest.get(begin..).unwrap_or_default();
        let mut values = Deserializer::from_slice(text).into_iter::<Value>();
        let value = values.next();
        let end = begin + values.byte_offset();
        match value {
            Some(Ok(Value::Object(object))) => {
                for row in rows(object, topic) {
                    let cells = cells(&row, &mut json.rows.header, &mut columns);
                    json.write(line, &cells).map_err(|error| not_written(file, error))?;
                }
                line += newlines(rest.get(..end).unwrap_or_default());
                at += end;
            }
            other => {
                let problem = match other {
                    Some(Err(error)) => format!("not a line of JSON: {}", reason(&error)),
                    _ => "not a line of JSON: not an object".to_owned(),
                };
                json.rows.broken.push((line, problem));
                let length = rest.iter().position(|byte| *byte == b'\n');
                let length = length.map_or(rest.len(), |length| length + 1);
                line += newlines(rest.get(..length).unwrap_or_default());
                at += length;
            }
        }
    }
    json.finish().map(Some).map_err(|error| not_written(file, error))
}

/// The cells of a row in the order of the columns; new keys are added to these.
fn cells(
    row: &[(String, String)],
    header: &mut Vec<String>,
    columns: &mut BTreeMap<String, usize>,
) -> Vec<String> {
    let mut cells = Vec::new();
    for (key, value) in row {
        let index = match columns.get(key) {
            Some(index) => *index,
            None if header.len() < MOST_COLUMNS => {
                let index = header.len();
                columns.insert(key.clone(), index);
                header.push(key.clone());
                index
            }
            None => continue,
        };
        if cells.len() <= index {
            cells.resize(index + 1, String::new());
        }
        if let Some(cell) = cells.get_mut(index) {
            // A row is a line.
            *cell = value.replace(['\r', '\n'], " ");
        }
    }
    if cells.is_empty() {
        // A row without cells would be skipped, and the lines of the others be wrong.
        cells.push(String::new());
    }
    cells
}

/// Returns true if a text begins as an object, a list of objects, or a topic and an object.
fn is_json(bytes: &[u8]) -> bool {
    let mut signs = bytes.iter().filter(|byte| !byte.is_ascii_whitespace());
    match signs.next() {
        Some(b'{') => signs.next().is_some_and(|byte| matches!(byte, b'"' | b'}')),
        Some(b'[') => signs.next() == Some(&b'{'),
        Some(_) => topic(bytes).is_some(),
        None => false,
    }
}

/// The topic of a message, and the space behind it, in front of an object, as `mosquitto_sub -v`
/// prints it.
fn topic(bytes: &[u8]) -> Option<&str> {
    let end = bytes.iter().position(|byte| byte.is_ascii_whitespace())?;
    let topic = std::str::from_utf8(bytes.get(..=end)?).ok()?;
    let is_object = bytes.get(end + 1) == Some(&b'{') && bytes.get(end) == Some(&b' ');
    (is_object && topic.contains('/')).then_some(topic)
}

fn newlines(bytes: &[u8]) -> u64 {
    bytes.iter().map(|byte| u64::from(*byte == b'\n')).sum()
}

/// The reason of an error, without its place, which counts from the value's begin.
fn reason(error: &serde_json::Error) -> String {
    let text = error.to_string();
    text.split(" at line ").next().unwrap_or_default().to_owned()
}

/// The rows of an object: one, or one for each receiver.
fn rows(object: Map<String, Value>, topic: Option<&str>) -> Vec<Vec<(String, String)>> {
    let mut value = unwrapped(Value::Object(object));
    let mut path = Vec::new();
    let receivers = take_receivers(&mut value, &mut path);
    let mut base = Vec::new();
    let prefix = match topic {
        None => "",
        Some(topic) => {
            let segments: Vec<&str> = topic.trim().split('/').collect();
            base.push(("topic".to_owned(), topic.trim().to_owned()));
            if let Some(last) = segments.last() {
                base.push(("topic.last".to_owned(), (*last).to_owned()));
            }
            for (index, segment) in segments.iter().take(MOST_ENTRIES).enumerate() {
                base.push((format!("topic.{index}"), (*segment).to_owned()));
            }
            "payload"
        }
    };
    flatten(prefix, &value, &mut base);
    if receivers.is_empty() {
        return vec![base];
    }
    let path = path.join(".");
    let row = |mut receiver: Value| {
        name_forwarder(&mut receiver);
        let mut row = base.clone();
        flatten(&path, &receiver, &mut row);
        row
    };
    receivers.into_iter().map(row).collect()
}

/// An object whose one key holds an object stands for that one: `{"result": {…}}`.
fn unwrapped(value: Value) -> Value {
    match value {
        Value::Object(object) if object.len() == 1 && object.values().all(Value::is_object) => {
            object.into_iter().next().map_or(Value::Null, |(_, inner)| inner)
        }
        other => other,
    }
}

/// Takes the list of receivers out of a value; `path` becomes the keys that lead to it.
fn take_receivers(value: &mut Value, path: &mut Vec<String>) -> Vec<Value> {
    let Value::Object(object) = value else { return Vec::new() };
    for (key, inner) in object.iter_mut() {
        path.push(key.clone());
        match inner {
            Value::Array(list)
                if RECEIVERS.contains(&key.as_str()) && list.iter().all(Value::is_object) =>
            {
                return std::mem::take(list);
            }
            Value::Object(_) => {
                let found = take_receivers(inner, path);
                if !found.is_empty() {
                    return found;
                }
            }
            _ => {}
        }
        path.pop();
    }
    Vec::new()
}

/// Receivers of other networks of The Things Stack share the name of the broker between them.
fn name_forwarder(receiver: &mut Value) {
    let forwarder = receiver.pointer("/packet_broker/forwarder_gateway_id").cloned();
    let name = receiver.pointer_mut("/gateway_ids/gateway_id");
    if let (Some(forwarder), Some(name)) = (forwarder, name)
        && name == "packetbroker"
    {
        *name = forwarder;
    }
}

/// Adds the keys of a value, joined by dots, with their texts; null has no text.
fn flatten(prefix: &str, value: &Value, row: &mut Vec<(String, String)>) {
    let joined = |key: &str| match prefix {
        "" => key.to_owned(),
        prefix => format!("{prefix}.{key}"),
    };
    match value {
        Value::Null => {}
        Value::Object(object) => {
            object.iter().for_each(|(key, inner)| flatten(&joined(key), inner, row));
        }
        Value::Array(list) if list.len() <= MOST_ENTRIES => {
            let entries = list.iter().enumerate();
            entries.for_each(|(index, inner)| flatten(&joined(&index.to_string()), inner, row));
        }
        Value::Array(_) => {}
        Value::String(text) => row.push((prefix.to_owned(), text.clone())),
        Value::Number(_) | Value::Bool(_) => row.push((prefix.to_owned(), value.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Rows {
        convert(text.as_bytes(), "f.json").expect("it is read").expect("JSON")
    }

    #[test]
    fn objects_are_rows_and_nested_keys_columns() {
        let lines = "{\"a\":1,\"b\":{\"c\":\"x,y\"}}\n\n{\"d\":true,\"a\":2.5}\n";
        let list = "[\n{\"a\":1,\"b\":{\"c\":\"x,y\"}},\n\n{\"d\":true,\"a\":2.5}]";
        for (text, lines) in [(lines, [1, 3]), (list, [2, 4])] {
            let json = read(text);
            assert_eq!(json.header, ["a", "b.c", "d"], "{text}");
            let csv = String::from_utf8(json.csv).expect("UTF-8");
            assert_eq!(csv, "\"1\",\"x,y\"\n\"2.5\",\"\",\"true\"\n");
            assert_eq!((json.lines, json.broken), (lines.to_vec(), vec![]));
        }
    }

    #[test]
    fn a_broken_line_is_one_broken_line() {
        let json = read("{\"a\":1}\n{\"a\":\n{\"a\":3}\nnoise\n{\"a\":4}\n");
        assert_eq!(json.lines, [1, 3, 5]);
        let lines: Vec<u64> = json.broken.iter().map(|(line, _)| *line).collect();
        assert_eq!(lines, [2, 4]);
    }

    #[test]
    fn each_receiver_is_a_row() {
        let json = read(
            "{\"result\":{\"id\":\"d\",\"up\":{\"rx_metadata\":[{\"rssi\":-1},{\"rssi\":-2,\
             \"gateway_ids\":{\"gateway_id\":\"packetbroker\"},\"packet_broker\":\
             {\"forwarder_gateway_id\":\"g\"}}]}}}",
        );
        assert_eq!(json.header[..2], ["id", "up.rx_metadata.rssi"]);
        let csv = String::from_utf8(json.csv).expect("UTF-8");
        assert_eq!(csv, "\"d\",\"-1\"\n\"d\",\"-2\",\"g\",\"g\"\n");
    }

    #[test]
    fn what_begins_otherwise_is_no_json() {
        for text in ["a,b\n", "", "[1,2]", "{a}", "x {\"a\":1}"] {
            assert_eq!(convert(text.as_bytes(), "f").expect("no error"), None, "{text}");
        }
        let json = read("home/room/kitchen {\"rssi\":-70}\n");
        let topic = ["topic", "topic.last", "topic.0", "topic.1", "topic.2"];
        assert_eq!(json.header[..5], topic);
        assert_eq!(json.header[5..], ["payload.rssi"]);
    }
}
