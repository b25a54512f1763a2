//! Cursor on Target: a hunt's features as events, and the platforms that take part.

use std::collections::HashMap;

use foxhunt_wire::geodesy::{Geodetic, LocalFrame};
use nalgebra::Vector3;

use super::{
    ExportError,
    feature::{Feature, Kind, LonLat, Shape, features, lon_lat},
    xml::{Xml, printable},
};
use crate::overview::{Overview, SearchOverview};
use foxhunt_archive::recording::utc;

/// Value of a height or an error that is not known.
const UNKNOWN: &str = "9999999.0";

/// Validity of an event that no later one replaces, in seconds.
pub(super) const HOLDS_S: f64 = 86_400.0;

/// Type of a drone.
pub(super) const IN_THE_AIR: &str = "a-f-A-M-H-Q";

/// Type of a receiver on the ground.
pub(super) const ON_THE_GROUND: &str = "a-f-G-U-C";

/// Largest number of an ellipse's corners: the outline then fits into one datagram of 1,500 bytes.
const MOST_CORNERS: usize = 24;

/// Attributes of an event.
pub(super) struct Head<'a> {
    pub uid: &'a str,
    /// Type of the event: an unknown thing on the ground, a drone, a line, a shape.
    pub kind: &'a str,
    /// Origin of the place: `m-g` from GNSS, `m-f` fused, `m-r` from radio, `m-s` simulated.
    pub how: &'a str,
    pub place: LonLat,
    /// Radius about the place that holds the thing with 95 %, in metres.
    pub radius_m: Option<f64>,
    /// UNIX times of the event, of the beginning of its validity and of the end, in seconds.
    pub times: [f64; 3],
}

pub(super) fn write(overview: &Overview, frame: &LocalFrame) -> Result<Vec<u8>, ExportError> {
    let epoch = overview.epoch_unix_s.ok_or(ExportError::NoTime)?;
    let mut xml = Xml::new();
    let mut names = Names::default();
    let [_, end] = overview.span();
    let times = |time: f64| [epoch + time, epoch + time, epoch + time + HOLDS_S];
    for receiver in &overview.receivers {
        let Some(last) = receiver.path.last() else { continue };
        let uid = names.unique(uid(overview, "receiver", &receiver.name));
        let place = lon_lat(frame, &last.place.xy());
        let times = times(last.time);
        let how = "m-g";
        let head = Head { uid: &uid, kind: IN_THE_AIR, how, place, radius_m: None, times };
        platform(&mut xml, &head, &receiver.name)?;
        xml.line()?;
    }
    for feature in &features(overview, frame) {
        let uid = names.unique(uid(overview, feature.kind.name(), &feature.name));
        let time = feature.time.unwrap_or(end);
        put(&mut xml, frame, feature, &uid, how(feature.kind), times(time))?;
        xml.line()?;
    }
    Ok(xml.into_bytes())
}

/// Returns the unique name of a thing. It depends on no other thing and on no time, so that an
/// event with later numbers replaces the earlier one.
pub(super) fn uid(overview: &Overview, kind: &str, name: &str) -> String {
    printable(&format!("foxhunt.{}.{kind}.{name}", overview.title))
}

/// Returns the origin of a feature's place.
pub(super) fn how(kind: Kind) -> &'static str {
    match kind {
        Kind::Path | Kind::Truth => "m-g",
        Kind::Bearing => "m-r",
        _ => "m-f",
    }
}

/// Writes the event of a receiver.
pub(super) fn platform(xml: &mut Xml, head: &Head<'_>, name: &str) -> Result<(), ExportError> {
    event(xml, head, |xml| callsign(xml, name))
}

/// Writes the event of a feature; nothing for one without a place.
pub(super) fn put(
    xml: &mut Xml,
    frame: &LocalFrame,
    feature: &Feature,
    uid: &str,
    how: &str,
    times: [f64; 3],
) -> Result<(), ExportError> {
    let number = |name: &str| {
        feature.numbers.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
    };
    let Some(place) = first(feature) else { return Ok(()) };
    let head = |kind| Head { uid, kind, how, place, radius_m: number("semi_major_95_m"), times };
    let name = format!("{} {}", feature.name, feature.kind.name());
    match (&feature.shape, feature.kind) {
        (_, Kind::Fix) => event(xml, &head("a-u-G"), |xml| {
            callsign(xml, &feature.name)?;
            remarks(xml, feature)
        }),
        (Shape::Point(_), _) => event(xml, &head("b-m-p-s-m"), |xml| {
            callsign(xml, &name)?;
            remarks(xml, feature)
        }),
        (Shape::Line(line), Kind::Bearing) => {
            let range_m = range_m(frame, line.iter().map(|(place, _)| place));
            let bearing = number("bearing_deg_compass").unwrap_or_default();
            event(xml, &head("u-rb-a"), |xml| {
                callsign(xml, &name)?;
                for (name, value) in [
                    ("range", format!("{range_m:.1}")),
                    ("bearing", format!("{bearing:.2}")),
                    ("inclination", "0.0".to_owned()),
                    // Metres, degrees, true North.
                    ("rangeUnits", "1".to_owned()),
                    ("bearingUnits", "0".to_owned()),
                    ("northRef", "0".to_owned()),
                ] {
                    xml.empty(name, &[("value", &value)])?;
                }
                stroke(xml, feature.kind)?;
                remarks(xml, feature)
            })
        }
        (Shape::Line(line), _) => event(xml, &head("u-d-f"), |xml| {
            callsign(xml, &name)?;
            corners(xml, line.iter().map(|(place, _)| place))?;
            stroke(xml, feature.kind)
        }),
        // Programs disagree about the angle and the axes of TAK's own ellipse (`u-d-c-e`), and
        // agree about corners.
        (Shape::Area(rings), _) => event(xml, &head("u-d-f"), |xml| {
            callsign(xml, &name)?;
            corners(xml, outline(rings, feature.kind))?;
            stroke(xml, feature.kind)?;
            // The fix has the ellipse's numbers; here they would not fit into a datagram.
            if feature.kind == Kind::Ellipse { Ok(()) } else { remarks(xml, feature) }
        }),
    }
}

/// Returns the corners of an area's outline, closed.
fn outline(rings: &[Vec<LonLat>], kind: Kind) -> impl Iterator<Item = &LonLat> {
    let ring = rings.first().map_or(&[][..], Vec::as_slice);
    let every = match kind {
        Kind::Ellipse => ring.len().saturating_sub(1).div_ceil(MOST_CORNERS).max(1),
        _ => 1,
    };
    let (last, others) = ring.split_last().map_or((None, ring), |(last, rest)| (Some(last), rest));
    others.iter().step_by(every).chain(last)
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
        Some(frame.to_local(&Geodetic { lat_deg, lon_deg, alt_m }).xy())
    };
    local().zip(local()).map_or(0.0, |(from, to)| (to - from).norm())
}

fn event(
    xml: &mut Xml,
    head: &Head<'_>,
    detail: impl FnOnce(&mut Xml) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    let [time, start, stale] = head.times.map(|unix_s| {
        let date = utc(unix_s);
        (!date.is_empty()).then(|| date.replacen(' ', "T", 1) + "Z").ok_or(ExportError::NoTime)
    });
    let uid = printable(head.uid);
    let attributes = [
        ("version", "2.0"),
        ("uid", uid.as_str()),
        ("type", head.kind),
        ("time", &time?),
        ("start", &start?),
        ("stale", &stale?),
        ("how", head.how),
    ];
    xml.element("event", &attributes, |xml| {
        let [lon, lat] = head.place.map(|degrees| degrees.to_string());
        let radius = head.radius_m.map_or_else(|| UNKNOWN.to_owned(), |m| format!("{m:.1}"));
        let point =
            [("lat", &*lat), ("lon", &lon), ("hae", UNKNOWN), ("ce", &radius), ("le", UNKNOWN)];
        xml.empty("point", &point)?;
        xml.element("detail", &[], detail)
    })
}

fn callsign(xml: &mut Xml, name: &str) -> Result<(), ExportError> {
    xml.empty("contact", &[("callsign", &printable(name))])
}

/// Writes corners to a ten-millionth of a degree, a centimetre.
fn corners<'a>(
    xml: &mut Xml,
    mut places: impl Iterator<Item = &'a LonLat>,
) -> Result<(), ExportError> {
    places.try_for_each(|[lon, lat]| xml.empty("link", &[("point", &format!("{lat:.7},{lon:.7}"))]))
}

/// Writes the colours of a line and of its inside, as signed numbers of alpha, red, green and blue.
fn stroke(xml: &mut Xml, kind: Kind) -> Result<(), ExportError> {
    let [red, green, blue] = match kind {
        Kind::Bearing => [0x00, 0x9e, 0x73],
        Kind::Path => [0x00, 0x72, 0xb2],
        Kind::Truth => [0x00, 0x00, 0x00],
        _ => [0xd5, 0x5e, 0x00],
    };
    let colour = |alpha| i32::from_be_bytes([alpha, red, green, blue]).to_string();
    xml.empty("strokeColor", &[("value", &colour(0xff))])?;
    xml.empty("strokeWeight", &[("value", "3.0")])?;
    match kind {
        Kind::Ellipse | Kind::Region => xml.empty("fillColor", &[("value", &colour(0x20))]),
        _ => Ok(()),
    }
}

fn remarks(xml: &mut Xml, feature: &Feature) -> Result<(), ExportError> {
    let numbers = feature.numbers.iter().map(|(name, value)| format!("{name} {value:.2}"));
    xml.text("remarks", &numbers.collect::<Vec<_>>().join(", "))
}

/// A receiver as teams see it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CotPlatform {
    /// Name of the receiver.
    pub name: String,
    /// True for a person, a car, a boat or a station.
    pub on_the_ground: bool,
}

/// Receivers of a hunt that goes on: names, and places that were reported beside receptions.
#[derive(Clone, Debug, Default)]
pub(super) struct Receivers {
    platforms: Vec<CotPlatform>,
    /// Reported places with their times.
    places: Vec<Option<(f64, Vector3<f64>)>>,
}

impl Receivers {
    /// Begins for receivers in the order of the hunt; those beyond have the hunt's own names, and
    /// are in the air.
    pub(super) fn new(platforms: Vec<CotPlatform>) -> Self {
        Self { platforms, places: Vec::new() }
    }

    /// Takes the place of a receiver at a time of the hunt: East, North and Up in metres.
    pub(super) fn place(&mut self, receiver: usize, time: f64, place: Vector3<f64>) {
        if self.places.len() <= receiver {
            self.places.resize(receiver + 1, None);
        }
        if let Some(kept) = self.places.get_mut(receiver) {
            *kept = Some((time, place));
        }
    }

    /// Returns the last known place of a receiver with its time.
    pub(super) fn last(&self, overview: &Overview, receiver: usize) -> Option<(f64, Vector3<f64>)> {
        let reported = self.places.get(receiver).copied().flatten();
        let of_hunt = overview.receivers.get(receiver).and_then(|receiver| receiver.path.last());
        // The hunt has a drone whose link is lost where it was sent.
        reported.or(of_hunt.map(|knot| (knot.time, knot.place)))
    }

    /// Returns the name of a receiver.
    pub(super) fn name(&self, overview: &Overview, receiver: usize) -> String {
        let own = self.platforms.get(receiver).map(|platform| &platform.name);
        let of_hunt = overview.receivers.get(receiver).map(|receiver| &receiver.name);
        let name = own.or(of_hunt).filter(|name| !name.is_empty());
        name.map_or_else(|| format!("receiver {}", receiver + 1), Clone::clone)
    }

    /// Returns the names of all receivers.
    pub(super) fn names<'a>(&'a self, overview: &'a Overview) -> impl Iterator<Item = String> + 'a {
        let receivers = overview.receivers.len().max(self.places.len());
        (0..receivers).map(|receiver| self.name(overview, receiver))
    }

    /// Returns true for a person, a car, a boat or a station.
    pub(super) fn is_on_the_ground(&self, receiver: usize) -> bool {
        self.platforms.get(receiver).is_some_and(|platform| platform.on_the_ground)
    }
}

/// Unique names. A name that is used again has a number behind it.
#[derive(Default)]
struct Names(HashMap<String, usize>);

impl Names {
    /// Returns the name, with a number behind it if it is used again.
    fn unique(&mut self, name: String) -> String {
        let count = self.0.entry(name.clone()).or_default();
        *count += 1;
        if *count == 1 { name } else { format!("{name}.{count}") }
    }
}

/// Returns names of which no two are one: one that is used again has a number behind it.
pub(super) fn unique(names: impl Iterator<Item = String>) -> Vec<String> {
    let mut used = Names::default();
    names.map(|name| used.unique(name)).collect()
}

/// Returns true if the belief is about receptions: a prior is no fix.
pub(super) fn is_found(search: &SearchOverview) -> bool {
    search.last().is_some_and(|last| last.steps > 0)
}
