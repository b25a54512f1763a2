use foxhunt_wire::geodesy::LocalFrame;

use super::{
    ExportError,
    feature::{Feature, Kind, LonLat, Shape, features, lon_lat, utc},
    xml::{Xml, printable},
};
use crate::overview::Overview;

/// Value of a height or an error that is not known.
const UNKNOWN: &str = "9999999.0";

/// Validity of an event, in seconds.
const HOLDS_S: f64 = 86_400.0;

/// An event's own.
struct Head<'a> {
    uid: String,
    /// The type: an unknown thing on the ground, a drone, a line, a shape.
    kind: &'a str,
    time: f64,
    place: LonLat,
    /// The radius about the place that holds it, in metres.
    radius_m: Option<f64>,
}

pub(super) fn write(overview: &Overview, frame: &LocalFrame) -> Result<Vec<u8>, ExportError> {
    let mut xml = Xml::new();
    let [_, end] = overview.span();
    for (index, receiver) in overview.receivers.iter().enumerate() {
        let Some(last) = receiver.path.last() else { continue };
        let place = lon_lat(frame, &last.place.xy());
        let uid = format!("foxhunt.{}.receiver.{index}", overview.title);
        let head = Head { uid, kind: "a-f-A-M-H-Q", time: last.time, place, radius_m: None };
        event(&mut xml, overview, &head, |xml| callsign(xml, &receiver.name))?;
    }
    for (index, feature) in features(overview, frame).iter().enumerate() {
        let uid = format!("foxhunt.{}.{}.{index}", overview.title, feature.kind.name());
        let number = |name: &str| {
            feature.numbers.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
        };
        let time = feature.time.unwrap_or(end);
        let Some(place) = first(feature) else { continue };
        let head = |kind| Head { uid, kind, time, place, radius_m: number("semi_major_95_m") };
        let name = format!("{} {}", feature.name, feature.kind.name());
        match (&feature.shape, feature.kind) {
            (_, Kind::Fix) => event(&mut xml, overview, &head("a-u-G"), |xml| {
                callsign(xml, &feature.name)?;
                remarks(xml, feature)
            })?,
            (Shape::Point(_), _) => event(&mut xml, overview, &head("b-m-p-s-m"), |xml| {
                callsign(xml, &name)?;
                remarks(xml, feature)
            })?,
            (Shape::Line(line), Kind::Bearing) => {
                let range = line.iter().map(|(place, _)| place);
                let range_m = range_m(frame, range);
                let bearing = number("bearing_deg_compass").unwrap_or_default();
                event(&mut xml, overview, &head("u-rb-a"), |xml| {
                    callsign(xml, &name)?;
                    xml.empty("range", &[("value", &format!("{range_m:.1}"))])?;
                    xml.empty("bearing", &[("value", &format!("{bearing:.2}"))])?;
                    remarks(xml, feature)
                })?;
            }
            (Shape::Line(line), _) => event(&mut xml, overview, &head("u-d-f"), |xml| {
                callsign(xml, &name)?;
                corners(xml, line.iter().map(|(place, _)| place))
            })?,
            (Shape::Area(rings), _) => event(&mut xml, overview, &head("u-d-f"), |xml| {
                callsign(xml, &name)?;
                corners(xml, rings.iter().take(1).flatten())?;
                remarks(xml, feature)
            })?,
        }
    }
    Ok(xml.into_bytes())
}

/// The place of a feature, or its first point.
fn first(feature: &Feature) -> Option<LonLat> {
    match &feature.shape {
        Shape::Point(place) => Some(*place),
        Shape::Line(line) => line.first().map(|(place, _)| *place),
        Shape::Area(rings) => rings.first()?.first().copied(),
    }
}

/// Length of a line's first segment, in metres.
fn range_m<'a>(frame: &LocalFrame, mut line: impl Iterator<Item = &'a LonLat>) -> f64 {
    let mut local = || {
        let [lon_deg, lat_deg] = *line.next()?;
        let alt_m = frame.origin().alt_m;
        Some(frame.to_local(&foxhunt_wire::geodesy::Geodetic { lat_deg, lon_deg, alt_m }).xy())
    };
    local().zip(local()).map_or(0.0, |(from, to)| (to - from).norm())
}

fn event(
    xml: &mut Xml,
    overview: &Overview,
    head: &Head<'_>,
    detail: impl FnOnce(&mut Xml) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    let utc = |time: f64| utc(overview, time).ok_or(ExportError::NoTime);
    let time = utc(head.time)?;
    let stale = utc(head.time + HOLDS_S)?;
    let uid = printable(&head.uid);
    let attributes = [
        ("version", "2.0"),
        ("uid", uid.as_str()),
        ("type", head.kind),
        ("time", &time),
        ("start", &time),
        ("stale", &stale),
        // Calculated by a machine.
        ("how", "m-g"),
    ];
    xml.element("event", &attributes, |xml| {
        let [lon, lat] = head.place.map(|degrees| degrees.to_string());
        let radius = head.radius_m.map_or_else(|| UNKNOWN.to_owned(), |m| format!("{m:.1}"));
        let point =
            [("lat", &*lat), ("lon", &lon), ("hae", UNKNOWN), ("ce", &radius), ("le", UNKNOWN)];
        xml.empty("point", &point)?;
        xml.element("detail", &[], detail)
    })?;
    xml.line()
}

fn callsign(xml: &mut Xml, name: &str) -> Result<(), ExportError> {
    xml.empty("contact", &[("callsign", &printable(name))])
}

fn corners<'a>(
    xml: &mut Xml,
    mut places: impl Iterator<Item = &'a LonLat>,
) -> Result<(), ExportError> {
    places.try_for_each(|[lon, lat]| xml.empty("link", &[("point", &format!("{lat},{lon}"))]))
}

fn remarks(xml: &mut Xml, feature: &Feature) -> Result<(), ExportError> {
    let numbers = feature.numbers.iter().map(|(name, value)| format!("{name} {value:.2}"));
    xml.text("remarks", &numbers.collect::<Vec<_>>().join(", "))
}
