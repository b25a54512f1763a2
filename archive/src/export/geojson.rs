use foxhunt_hunt::document;
use foxhunt_wire::geodesy::LocalFrame;
use serde_json::{Map, Value, json};

use super::{
    ExportError,
    feature::{Feature, Shape, features, utc},
};
use crate::overview::Overview;

pub(super) fn write(overview: &Overview, frame: &LocalFrame) -> Result<Vec<u8>, ExportError> {
    document::to_json(&collection(overview, frame))
        .map(String::into_bytes)
        .map_err(ExportError::write)
}

/// The collection of all features (RFC 7946, section 3.3).
pub(super) fn collection(overview: &Overview, frame: &LocalFrame) -> Value {
    let features = features(overview, frame);
    let features: Vec<Value> = features.iter().map(|one| feature(overview, one)).collect();
    json!({ "type": "FeatureCollection", "features": features })
}

fn feature(overview: &Overview, feature: &Feature) -> Value {
    let mut properties = Map::new();
    let _ = properties.insert("kind".to_owned(), feature.kind.name().into());
    let _ = properties.insert("name".to_owned(), feature.name.clone().into());
    if let Some(time) = feature.time {
        let _ = properties.insert("time_s".to_owned(), time.into());
        if let Some(utc) = utc(overview, time) {
            let _ = properties.insert("time".to_owned(), utc.into());
        }
    }
    for (name, value) in &feature.numbers {
        let _ = properties.insert((*name).to_owned(), json!(value));
    }
    let geometry = match &feature.shape {
        Shape::Point(place) => json!({ "type": "Point", "coordinates": place }),
        Shape::Line(line) => {
            let line: Vec<_> = line.iter().map(|(place, _)| place).collect();
            json!({ "type": "LineString", "coordinates": line })
        }
        // The first ring is counter-clockwise, as section 3.1.6 has it, and its holes the other
        // way.
        Shape::Area(rings) => json!({ "type": "Polygon", "coordinates": rings }),
    };
    json!({ "type": "Feature", "geometry": geometry, "properties": properties })
}
