use std::{collections::BTreeMap, io::Cursor};

use ::mcap::{WriteOptions, Writer, records::MessageHeader};
use foxhunt_hunt::document;
use foxhunt_wire::geodesy::LocalFrame;
use nalgebra::{Matrix2, Vector3};
use serde_json::{Value, json};

use super::{ExportError, geojson};
use crate::overview::Overview;

/// A message that waits for its turn: when, on which topic, of which schema.
struct Message {
    time: f64,
    topic: String,
    schema: &'static str,
    data: Value,
}

/// Fixes and paths as `foxglove.LocationFix`, events as `foxglove.Log`, the map as it is in the end
/// as `foxglove.GeoJSON`. Times count from 1970 where that of the beginning is not known.
pub(super) fn write(overview: &Overview, frame: &LocalFrame) -> Result<Vec<u8>, ExportError> {
    let mut messages = messages(overview, frame)?;
    messages.sort_by(|a, b| a.time.total_cmp(&b.time));
    let options = WriteOptions::new().compression(None).library("foxhunt");
    let mut writer = options.create(Cursor::new(Vec::new())).map_err(ExportError::write)?;
    let mut channels = BTreeMap::new();
    for (sequence, message) in (0..).zip(&messages) {
        let channel_id = match channels.get(&message.topic) {
            Some(id) => *id,
            None => {
                let id = channel(&mut writer, message)?;
                let _ = channels.insert(message.topic.clone(), id);
                id
            }
        };
        let nanoseconds = nanoseconds(message.time);
        let header = MessageHeader {
            channel_id,
            sequence,
            log_time: nanoseconds,
            publish_time: nanoseconds,
        };
        let data = document::to_json(&message.data).map_err(ExportError::write)?.into_bytes();
        writer.write_to_known_channel(&header, &data).map_err(ExportError::write)?;
    }
    let _ = writer.finish().map_err(ExportError::write)?;
    Ok(writer.into_inner().into_inner())
}

fn channel(writer: &mut Writer<Cursor<Vec<u8>>>, message: &Message) -> Result<u16, ExportError> {
    let text = schema(message.schema).to_string();
    let schema = writer
        .add_schema(message.schema, "jsonschema", text.as_bytes())
        .map_err(ExportError::write)?;
    writer.add_channel(schema, &message.topic, "json", &BTreeMap::new()).map_err(ExportError::write)
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "casts saturate")]
fn nanoseconds(time: f64) -> u64 {
    // Milliseconds: a double has no nanoseconds of our years.
    ((time * 1e3).round().max(0.0) as u64).saturating_mul(1_000_000)
}

fn stamp(time: f64) -> Value {
    let nanoseconds = nanoseconds(time);
    json!({ "sec": nanoseconds / 1_000_000_000, "nsec": nanoseconds % 1_000_000_000 })
}

fn messages(overview: &Overview, frame: &LocalFrame) -> Result<Vec<Message>, ExportError> {
    let epoch = overview.epoch_unix_s.unwrap_or(0.0);
    let mut messages = Vec::new();
    let fix = |time: f64, name: &str, place: &Vector3<f64>, covariance: Option<Matrix2<f64>>| {
        let place = frame.to_geodetic(place);
        let c = covariance.unwrap_or_default();
        json!({
            "timestamp": stamp(time),
            "frame_id": name,
            "latitude": place.lat_deg,
            "longitude": place.lon_deg,
            "altitude": place.alt_m,
            "position_covariance": [c.m11, c.m12, 0.0, c.m21, c.m22, 0.0, 0.0, 0.0, 0.0],
            // 0 is unknown, 3 is known.
            "position_covariance_type": if covariance.is_some() { 3 } else { 0 },
        })
    };
    for receiver in &overview.receivers {
        for knot in &receiver.path {
            let time = epoch + knot.time;
            messages.push(Message {
                time,
                topic: format!("/receivers/{}", receiver.name),
                schema: "foxglove.LocationFix",
                data: fix(time, &receiver.name, &knot.place, None),
            });
        }
    }
    for search in &overview.searches {
        for believed in &search.beliefs {
            let time = epoch + believed.time;
            let place = believed.estimate.mean.push(0.0);
            messages.push(Message {
                time,
                topic: format!("/beacons/{}", search.name),
                schema: "foxglove.LocationFix",
                data: fix(time, &search.name, &place, Some(believed.estimate.covariance)),
            });
        }
    }
    for notice in &overview.notices {
        let time = epoch + notice.time;
        messages.push(Message {
            time,
            topic: "/log".to_owned(),
            schema: "foxglove.Log",
            data: json!({
                "timestamp": stamp(time),
                // 1 is debug, 2 is info.
                "level": if notice.important { 2 } else { 1 },
                "message": notice.text,
                "name": "foxhunt",
                "file": "",
                "line": 0,
            }),
        });
    }
    let map = geojson::collection(overview, frame);
    let text = document::to_json(&map).map_err(ExportError::write)?;
    messages.push(Message {
        time: epoch + overview.span()[1],
        topic: "/map".to_owned(),
        schema: "foxglove.GeoJSON",
        data: json!({ "geojson": text }),
    });
    Ok(messages)
}

/// The JSON schema of a message of Foxglove's.
fn schema(name: &str) -> Value {
    let number = json!({ "type": "number" });
    let text = json!({ "type": "string" });
    let whole = json!({ "type": "integer" });
    let time = json!({
        "type": "object",
        "title": "time",
        "properties": { "sec": whole, "nsec": whole },
    });
    let properties = match name {
        "foxglove.LocationFix" => json!({
            "timestamp": time,
            "frame_id": text,
            "latitude": number,
            "longitude": number,
            "altitude": number,
            "position_covariance": {
                "type": "array", "items": number, "minItems": 9, "maxItems": 9,
            },
            "position_covariance_type": whole,
        }),
        "foxglove.Log" => json!({
            "timestamp": time,
            "level": whole,
            "message": text,
            "name": text,
            "file": text,
            "line": whole,
        }),
        _ => json!({ "geojson": text }),
    };
    json!({ "title": name, "type": "object", "properties": properties })
}
