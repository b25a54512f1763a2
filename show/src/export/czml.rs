use std::collections::HashMap;

use foxhunt_hunt::document;
use foxhunt_wire::geodesy::LocalFrame;
use serde_json::{Value, json};

use super::{
    ExportError,
    feature::{Feature, Kind, LonLat, Shape, features, utc},
};
use crate::overview::Overview;

/// Writes the packets of CZML 1.0: paths with their times where the epoch is known, all else as it
/// is in the end. Everything lies on the ground.
pub(super) fn write(overview: &Overview, frame: &LocalFrame) -> Result<Vec<u8>, ExportError> {
    let mut packets = vec![json!({
        "id": "document",
        "name": overview.title,
        "version": "1.0",
    })];
    if let (Some(document), Some(interval)) = (packets.first_mut(), interval(overview)) {
        let [_, end] = overview.span();
        let clock = json!({
            "interval": interval,
            "currentTime": utc(overview, end),
            "range": "CLAMPED",
            "step": "SYSTEM_CLOCK_MULTIPLIER",
        });
        if let Some(document) = document.as_object_mut() {
            let _ = document.insert("clock".to_owned(), clock);
        }
    }
    let mut ids: HashMap<String, usize> = HashMap::new();
    for feature in &features(overview, frame) {
        let id = format!("{}/{}", feature.kind.name(), feature.name);
        let count = ids.entry(id.clone()).or_default();
        *count += 1;
        let id = if *count == 1 { id } else { format!("{id}/{count}") };
        packets.push(packet(overview, feature, &id));
    }
    document::to_json(&packets).map(String::into_bytes).map_err(ExportError::write)
}

/// The time that the overview takes, as an interval of ISO 8601.
fn interval(overview: &Overview) -> Option<String> {
    let [start, end] = overview.span().map(|time| utc(overview, time));
    Some(format!("{}/{}", start?, end?))
}

fn packet(overview: &Overview, feature: &Feature, id: &str) -> Value {
    let numbers = feature.numbers.iter().map(|(name, value)| format!("{name} {value:.2}"));
    let about = numbers.collect::<Vec<_>>().join("<br>");
    let [line, area] = colours(feature.kind);
    let mut packet = json!({ "id": id, "name": feature.name, "description": about });
    let Some(put) = packet.as_object_mut() else { return packet };
    let mut put = |name: &str, value: Value| {
        let _ = put.insert(name.to_owned(), value);
    };
    let solid = json!({ "solidColor": { "color": { "rgba": line } } });
    match &feature.shape {
        Shape::Point([lon, lat]) => {
            put("position", json!({ "cartographicDegrees": [lon, lat, 0.0] }));
            put("point", point(line));
            put(
                "label",
                json!({
                    "text": feature.name,
                    "font": "14px sans-serif",
                    "horizontalOrigin": "LEFT",
                    "pixelOffset": { "cartesian2": [10.0, 0.0] },
                }),
            );
        }
        Shape::Line(places) => match (feature.kind, path(overview, places)) {
            (Kind::Path, Some((availability, position))) => {
                put("availability", availability);
                put("position", position);
                put("point", point(line));
                put("path", json!({ "material": solid, "width": 2.0, "leadTime": 0.0 }));
            }
            _ => put(
                "polyline",
                json!({
                    "positions": flat(places.iter().map(|(place, _)| place)),
                    "material": solid,
                    "width": 2.0,
                    "clampToGround": true,
                }),
            ),
        },
        Shape::Area(rings) => {
            let outer = rings.first().map(flat).unwrap_or_default();
            let holes: Vec<Value> = rings.iter().skip(1).map(flat).collect();
            let holes = holes.iter().map(|hole| &hole["cartographicDegrees"]).collect::<Vec<_>>();
            put(
                "polygon",
                json!({
                    "positions": outer,
                    "holes": { "cartographicDegrees": holes },
                    "material": { "solidColor": { "color": { "rgba": area } } },
                }),
            );
            put(
                "polyline",
                json!({
                    "positions": outer,
                    "material": solid,
                    "width": 2.0,
                    "clampToGround": true,
                }),
            );
        }
    }
    packet
}

/// Availability and position of a receiver by its times, in seconds from the first.
fn path(overview: &Overview, places: &[(LonLat, f64)]) -> Option<(Value, Value)> {
    let [(_, first), .., (_, last)] = places else { return None };
    let [start, end] = [first, last].map(|time| utc(overview, *time));
    let start = start?;
    let mut samples: Vec<f64> = Vec::new();
    for ([lon, lat], time) in places {
        samples.extend([time - first, *lon, *lat, 0.0]);
    }
    let availability = json!(format!("{start}/{}", end?));
    Some((availability, json!({ "epoch": start, "cartographicDegrees": samples })))
}

fn flat<'a>(places: impl IntoIterator<Item = &'a LonLat>) -> Value {
    let numbers = places.into_iter().flat_map(|[lon, lat]| [*lon, *lat, 0.0]);
    json!({ "cartographicDegrees": numbers.collect::<Vec<_>>() })
}

fn point(colour: [u8; 4]) -> Value {
    json!({ "pixelSize": 10.0, "color": { "rgba": colour }, "heightReference": "CLAMP_TO_GROUND" })
}

/// Colours of lines and areas: red, green, blue, alpha.
fn colours(kind: Kind) -> [[u8; 4]; 2] {
    let [red, green, blue] = match kind {
        Kind::Bearing => [0x00, 0x9e, 0x73],
        Kind::Path => [0x00, 0x72, 0xb2],
        Kind::Smoothed => [0xcc, 0x79, 0xa7],
        Kind::Truth => [0x00, 0x00, 0x00],
        _ => [0xd5, 0x5e, 0x00],
    };
    [0xff, 0x40].map(|alpha| [red, green, blue, alpha])
}
