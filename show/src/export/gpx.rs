use foxhunt_wire::geodesy::LocalFrame;

use super::{
    ExportError,
    feature::{Feature, Kind, LonLat, Shape, features, utc},
    xml::Xml,
};
use crate::overview::Overview;

pub(super) fn write(overview: &Overview, frame: &LocalFrame) -> Result<Vec<u8>, ExportError> {
    let features = features(overview, frame);
    let mut xml = Xml::document()?;
    let root = [
        ("version", "1.1"),
        ("creator", "foxhunt"),
        ("xmlns", "http://www.topografix.com/GPX/1/1"),
    ];
    xml.element("gpx", &root, |xml| {
        xml.element("metadata", &[], |xml| xml.text("name", &overview.title))?;
        // The schema has all waypoints before all tracks.
        for feature in &features {
            if let Shape::Point(place) = &feature.shape {
                point(xml, overview, "wpt", place, feature.time, |xml| {
                    xml.text("name", &feature.name)?;
                    let numbers = feature.numbers.iter();
                    let numbers = numbers.map(|(name, value)| format!("{name} {value:.2}"));
                    xml.text("desc", &numbers.collect::<Vec<_>>().join(", "))?;
                    xml.text("type", feature.kind.name())
                })?;
            }
        }
        for feature in &features {
            if !matches!(feature.kind, Kind::Bearing) {
                track(xml, overview, feature)?;
            }
        }
        bearings(xml, overview, &features)
    })?;
    Ok(xml.into_bytes())
}

fn point(
    xml: &mut Xml,
    overview: &Overview,
    name: &str,
    [lon, lat]: &LonLat,
    time: Option<f64>,
    more: impl FnOnce(&mut Xml) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    let lat = lat.to_string();
    let lon = lon.to_string();
    xml.element(name, &[("lat", &lat), ("lon", &lon)], |xml| {
        if let Some(utc) = time.and_then(|time| utc(overview, time)) {
            xml.text("time", &utc)?;
        }
        more(xml)
    })
}

/// A path, a way or a border as a track.
fn track(xml: &mut Xml, overview: &Overview, feature: &Feature) -> Result<(), ExportError> {
    let segments: Vec<Vec<(LonLat, Option<f64>)>> = match &feature.shape {
        Shape::Point(_) => return Ok(()),
        Shape::Line(line) => vec![line.iter().map(|(place, time)| (*place, Some(*time))).collect()],
        Shape::Area(rings) => {
            rings.iter().map(|ring| ring.iter().map(|place| (*place, None)).collect()).collect()
        }
    };
    let name = format!("{} {}", feature.name, feature.kind.name());
    segments_of(xml, overview, &name, feature.kind, &segments)
}

/// The bearings of each receiver as one track, a segment for each.
fn bearings(xml: &mut Xml, overview: &Overview, features: &[Feature]) -> Result<(), ExportError> {
    for receiver in &overview.receivers {
        let own =
            features.iter().filter(|one| one.kind == Kind::Bearing && one.name == receiver.name);
        let segments: Vec<Vec<(LonLat, Option<f64>)>> = own
            .filter_map(|one| match &one.shape {
                Shape::Line(line) => {
                    Some(line.iter().map(|(place, time)| (*place, Some(*time))).collect())
                }
                _ => None,
            })
            .collect();
        if !segments.is_empty() {
            let name = format!("{} bearings", receiver.name);
            segments_of(xml, overview, &name, Kind::Bearing, &segments)?;
        }
    }
    Ok(())
}

fn segments_of(
    xml: &mut Xml,
    overview: &Overview,
    name: &str,
    kind: Kind,
    segments: &[Vec<(LonLat, Option<f64>)>],
) -> Result<(), ExportError> {
    xml.element("trk", &[], |xml| {
        xml.text("name", name)?;
        xml.text("type", kind.name())?;
        segments.iter().try_for_each(|segment| {
            xml.element("trkseg", &[], |xml| {
                segment.iter().try_for_each(|(place, time)| {
                    point(xml, overview, "trkpt", place, *time, |_| Ok(()))
                })
            })
        })
    })
}
