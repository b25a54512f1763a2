//! Features of an overview on Earth, which exports write, and GeoJSON of them.

use foxhunt_core::Ellipse;
use foxhunt_hunt::document;
use foxhunt_wire::geodesy::{LocalFrame, radians_to_compass_deg};
use nalgebra::{Vector2, Vector3};
use serde_json::{Map, Value, json};

use super::ExportError;
use crate::overview::{Believed, Overview, Received, SearchOverview};

/// Something on the map.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Feature {
    /// Kind of the feature.
    pub kind: Kind,
    /// Name of the beacon or the receiver that it belongs to.
    pub name: String,
    /// Time in seconds of the overview.
    pub time: Option<f64>,
    /// Shape of the feature: one point, the points of a line, or the rings of an area, each closed.
    pub shape: Shape,
    /// Other quantities, by names with units.
    pub numbers: Vec<(&'static str, f64)>,
}

/// Kind of a feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// The believed place of a beacon.
    Fix,
    /// Another place that is nearly as probable.
    Rival,
    /// The ellipse that holds a beacon with 95 %.
    Ellipse,
    /// A part of the region that does.
    Region,
    /// The fixes of a beacon over time.
    Track,
    /// The places of a beacon over time, given all receptions.
    Smoothed,
    /// The true place or way of a beacon.
    Truth,
    /// The path of a receiver.
    Path,
    /// A bearing, from the receiver as far as the field reaches.
    Bearing,
}

impl Kind {
    /// Returns the name of the kind in files.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Fix => "fix",
            Self::Rival => "rival",
            Self::Ellipse => "ellipse-95",
            Self::Region => "region-95",
            Self::Track => "track",
            Self::Smoothed => "smoothed-track",
            Self::Truth => "truth",
            Self::Path => "path",
            Self::Bearing => "bearing",
        }
    }
}

/// Longitude and latitude in degrees.
pub(super) type LonLat = [f64; 2];

/// The form of a feature, with the time of each point of a line.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Shape {
    Point(LonLat),
    Line(Vec<(LonLat, f64)>),
    Area(Vec<Vec<LonLat>>),
}

/// Number of an ellipse's corners.
const CORNERS: u16 = 72;

/// A hundred-millionth of a degree is a millimetre.
fn rounded(degrees: f64) -> f64 {
    (degrees * 1e8).round() / 1e8
}

pub(super) fn lon_lat(frame: &LocalFrame, place: &Vector2<f64>) -> LonLat {
    let place = frame.to_geodetic(&place.push(0.0));
    [rounded(place.lon_deg), rounded(place.lat_deg)]
}

/// UTC of a time of the overview, as in `2021-03-21T16:51:48.250Z`.
pub(super) fn utc(overview: &Overview, time: f64) -> Option<String> {
    let date = foxhunt_archive::recording::utc(overview.epoch_unix_s? + time);
    (!date.is_empty()).then(|| date.replacen(' ', "T", 1) + "Z")
}

/// Length of drawn bearings, in metres: across the field.
pub(super) fn reach_m(overview: &Overview) -> f64 {
    let fixes = overview.searches.iter().filter_map(|search| search.last());
    let places = (overview.received.iter().map(|received| received.place.xy()))
        .chain(fixes.map(|believed| believed.estimate.mean));
    let mut corners: Option<[Vector2<f64>; 2]> = None;
    for place in places.filter(|place| place.iter().all(|c| c.is_finite())) {
        let [low, high] = corners.unwrap_or([place, place]);
        corners = Some([low.inf(&place), high.sup(&place)]);
    }
    corners.map_or(0.0, |[low, high]| (high - low).norm()).clamp(10.0, 50_000.0)
}

/// The corners of an ellipse about a place, closed.
fn outline(mean: &Vector2<f64>, ellipse: &Ellipse) -> Vec<Vector2<f64>> {
    let (sin, cos) = libm::sincos(ellipse.orientation);
    let corner = |i: u16| {
        let turn = std::f64::consts::TAU * f64::from(i % CORNERS) / f64::from(CORNERS);
        let (s, c) = libm::sincos(turn);
        let along = ellipse.semi_major * c;
        let across = ellipse.semi_minor * s;
        mean + Vector2::new(along * cos - across * sin, along * sin + across * cos)
    };
    (0..=CORNERS).map(corner).collect()
}

/// All there is on the map.
pub(super) fn features(overview: &Overview, frame: &LocalFrame) -> Vec<Feature> {
    let mut features = Vec::new();
    let at = |place: &Vector2<f64>| lon_lat(frame, place);
    let knot = |place: &Vector3<f64>, time: f64| (at(&place.xy()), time);
    for receiver in &overview.receivers {
        let line: Vec<_> = receiver.path.iter().map(|k| knot(&k.place, k.time)).collect();
        if line.len() > 1 {
            features.push(Feature::of(Kind::Path, &receiver.name, Shape::Line(line)));
        }
    }
    let reach_m = reach_m(overview);
    features.extend(overview.received.iter().filter_map(|r| bearing(overview, frame, r, reach_m)));
    for search in &overview.searches {
        let name = &search.name;
        let truth = match search.truth.as_slice() {
            [] => None,
            [only] => Some(Shape::Point(at(&only.place.xy()))),
            way => Some(Shape::Line(way.iter().map(|k| knot(&k.place, k.time)).collect())),
        };
        features.extend(truth.map(|shape| Feature::of(Kind::Truth, name, shape)));
        if search.beliefs.len() > 1 {
            let line = search.beliefs.iter().map(|b| (at(&b.estimate.mean), b.time)).collect();
            features.push(Feature::of(Kind::Track, name, Shape::Line(line)));
        }
        if search.smoothed.len() > 1 {
            let line = search.smoothed.iter().map(|b| (at(&b.estimate.mean), b.time)).collect();
            features.push(Feature::of(Kind::Smoothed, name, Shape::Line(line)));
        }
        for region in &search.regions_95 {
            let ring = |border: &Vec<Vector2<f64>>| border.iter().map(at).collect();
            let rings = std::iter::once(&region.outline).chain(&region.holes).map(ring).collect();
            let numbers = vec![("probability", region.probability), ("area_m2", region.area_m2)];
            let shape = Shape::Area(rings);
            features.push(Feature { numbers, ..Feature::of(Kind::Region, name, shape) });
        }
        features.extend(found(search, frame));
    }
    features
}

/// The places where a beacon may be: the fix with its ellipse, and its rivals.
pub(super) fn found(search: &SearchOverview, frame: &LocalFrame) -> Vec<Feature> {
    let at = |place: &Vector2<f64>| lon_lat(frame, place);
    let name = &search.name;
    let rivals = search.rivals.iter().map(|rival| {
        let numbers = vec![("relative_density", rival.relative_density)];
        let shape = Shape::Point(at(&rival.place));
        Feature { numbers, ..Feature::of(Kind::Rival, name, shape) }
    });
    let mut features: Vec<_> = rivals.collect();
    let Some(last) = search.last() else { return features };
    let time = Some(last.time);
    if let Some(ellipse) = &last.ellipse_95 {
        let ring = outline(&last.estimate.mean, ellipse).iter().map(at).collect();
        let shape = Shape::Area(vec![ring]);
        let numbers = numbers(last);
        features.push(Feature { time, numbers, ..Feature::of(Kind::Ellipse, name, shape) });
    }
    let shape = Shape::Point(at(&last.estimate.mean));
    let numbers = numbers(last);
    features.push(Feature { time, numbers, ..Feature::of(Kind::Fix, name, shape) });
    features
}

/// Numbers of a fix: place, ellipse and error.
fn numbers(believed: &Believed) -> Vec<(&'static str, f64)> {
    let place = believed.estimate.mean;
    let mut numbers = vec![("east_m", place.x), ("north_m", place.y)];
    if let Some(ellipse) = &believed.ellipse_95 {
        numbers.push(("semi_major_95_m", ellipse.semi_major));
        numbers.push(("semi_minor_95_m", ellipse.semi_minor));
        numbers.push(("along_deg_compass", along_deg_compass(ellipse)));
    }
    numbers.extend(believed.error_m.map(|error| ("error_m", error)));
    numbers
}

/// The direction of the longer axis, from 0 to 180 degrees clockwise from North.
pub(super) fn along_deg_compass(ellipse: &Ellipse) -> f64 {
    radians_to_compass_deg(ellipse.orientation).rem_euclid(180.0)
}

/// Returns a direction at a place, clockwise from true North there where its frame is known.
pub(super) fn compass_deg(frame: Option<&LocalFrame>, place: &Vector3<f64>, radians: f64) -> f64 {
    match frame {
        Some(frame) => frame.compass_deg(&frame.to_geodetic(place), radians),
        None => radians_to_compass_deg(radians),
    }
}

/// The line of a reception's bearing, as long as `reach_m`.
pub(super) fn bearing(
    overview: &Overview,
    frame: &LocalFrame,
    received: &Received,
    reach_m: f64,
) -> Option<Feature> {
    let bearing = received.bearing.as_ref()?;
    let from = received.place.xy();
    let (sin, cos) = libm::sincos(bearing.angle);
    let to = from + Vector2::new(cos, sin) * reach_m;
    let ends = [from, to].map(|place| (lon_lat(frame, &place), received.time));
    let mut numbers = vec![
        ("bearing_deg_compass", compass_deg(Some(frame), &received.place, bearing.angle)),
        ("bearing_sigma_deg", bearing.sigma.to_degrees()),
        ("confidence", bearing.confidence),
    ];
    numbers.extend(received.level.map(|level| ("rss_dbm", level.rss_dbm)));
    numbers.push(("used", f64::from(u8::from(received.used))));
    let name = overview.receivers.get(received.receiver).map_or("", |receiver| &receiver.name);
    Some(Feature {
        time: Some(received.time),
        numbers,
        ..Feature::of(Kind::Bearing, name, Shape::Line(ends.to_vec()))
    })
}

impl Feature {
    fn of(kind: Kind, name: &str, shape: Shape) -> Self {
        Self { kind, name: name.to_owned(), time: None, shape, numbers: Vec::new() }
    }
}

pub(super) fn write_geojson(
    overview: &Overview,
    frame: &LocalFrame,
) -> Result<Vec<u8>, ExportError> {
    document::to_json(&geojson(overview, frame)).map(String::into_bytes).map_err(ExportError::write)
}

/// The collection of all features (RFC 7946, section 3.3).
pub(super) fn geojson(overview: &Overview, frame: &LocalFrame) -> Value {
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
