//! Poses, estimates and the log of a hunt as messages of ROS 2 in MCAP, with the definitions of
//! their types.

use std::{collections::BTreeMap, io::Cursor};

use ::mcap::{WriteOptions, Writer, records::MessageHeader};
use foxhunt_hunt::document;
use foxhunt_wire::geodesy::LocalFrame;
use nalgebra::{Matrix2, Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::{ExportError, feature::geojson};
use crate::overview::{Knot, Overview};

/// Frame of East, North and Up, as of the nodes of a hunt.
const MAP: &str = "map";

/// Frame of Earth-centred, Earth-fixed coordinates (REP 105).
const EARTH: &str = "earth";

/// Variance of what is not estimated, in m² and rad², as of the nodes of a hunt.
const UNKNOWN: f64 = 1e6;

/// Most messages with the path of a receiver; each holds the path up to its time.
const PATHS: usize = 32;

/// A message that waits for its turn.
struct Message {
    time: f64,
    topic: String,
    /// Name of the type, such as `nav_msgs/msg/Path`.
    kind: &'static str,
    /// Name of the receiver or the beacon; empty for the whole hunt.
    name: String,
    data: Vec<u8>,
}

/// A frame in its parent's coordinates.
struct Transform<'a> {
    parent: &'a str,
    child: &'a str,
    place: Vector3<f64>,
    turn: UnitQuaternion<f64>,
}

/// Poses, paths, estimates and fixes on the topics of a hunt's nodes, transforms, the log, and the
/// map in the end, as messages of ROS 2. Times count from 1970 where the epoch is not known.
pub(super) fn write(overview: &Overview, frame: &LocalFrame) -> Result<Vec<u8>, ExportError> {
    let mut messages = messages(overview, frame)?;
    messages.sort_by(|a, b| a.time.total_cmp(&b.time));
    // `profile` makes it a bag of ROS 2.
    let options = WriteOptions::new().compression(None).library("foxhunt").profile("ros2");
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
        writer.write_to_known_channel(&header, &message.data).map_err(ExportError::write)?;
    }
    let _ = writer.finish().map_err(ExportError::write)?;
    Ok(writer.into_inner().into_inner())
}

fn channel(writer: &mut Writer<Cursor<Vec<u8>>>, message: &Message) -> Result<u16, ExportError> {
    let definition = definition(message.kind);
    let schema = writer
        .add_schema(message.kind, "ros2msg", definition.as_bytes())
        .map_err(ExportError::write)?;
    let mut metadata = BTreeMap::new();
    if !message.name.is_empty() {
        let _ = metadata.insert("name".to_owned(), message.name.clone());
    }
    writer.add_channel(schema, &message.topic, "cdr", &metadata).map_err(ExportError::write)
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "casts saturate")]
fn nanoseconds(time: f64) -> u64 {
    // Milliseconds: a double has no nanoseconds of our years.
    ((time * 1e3).round().max(0.0) as u64).saturating_mul(1_000_000)
}

/// Writes a `builtin_interfaces/Time`.
fn stamp(cdr: &mut CdrWriter, time: f64) {
    const SECOND: u64 = 1_000_000_000;
    let nanoseconds = nanoseconds(time);
    cdr.u32(i32::try_from(nanoseconds / SECOND).unwrap_or(i32::MAX).unsigned_abs());
    cdr.u32(u32::try_from(nanoseconds % SECOND).unwrap_or_default());
}

/// Writes a `std_msgs/Header`.
fn header(cdr: &mut CdrWriter, time: f64, frame: &str) {
    stamp(cdr, time);
    cdr.text(frame);
}

/// Writes a `geometry_msgs/Pose` of a place; its attitude is not known.
fn pose(cdr: &mut CdrWriter, place: &Vector3<f64>) {
    cdr.f64s(place.iter().copied());
    cdr.f64s([0.0, 0.0, 0.0, 1.0]);
}

fn pose_stamped(cdr: &mut CdrWriter, time: f64, place: &Vector3<f64>) {
    header(cdr, time, MAP);
    pose(cdr, place);
}

fn path(epoch: f64, knots: &[Knot]) -> Option<Vec<u8>> {
    let last = knots.last()?;
    let mut cdr = CdrWriter::new();
    header(&mut cdr, epoch + last.time, MAP);
    cdr.length(knots.len());
    for knot in knots {
        pose_stamped(&mut cdr, epoch + knot.time, &knot.place);
    }
    Some(cdr.into_bytes())
}

fn estimate(time: f64, place: &Vector3<f64>, covariance: &Matrix2<f64>) -> Vec<u8> {
    let mut cdr = CdrWriter::new();
    pose_stamped(&mut cdr, time, place);
    for row in 0..6 {
        for column in 0..6 {
            let unknown = if row == column { UNKNOWN } else { 0.0 };
            cdr.f64s([covariance.get((row, column)).copied().unwrap_or(unknown)]);
        }
    }
    cdr.into_bytes()
}

fn fix(
    frame: &LocalFrame,
    time: f64,
    name: &str,
    place: &Vector3<f64>,
    covariance: Option<Matrix2<f64>>,
) -> Vec<u8> {
    let place = frame.to_geodetic(place);
    let c = covariance.unwrap_or_default();
    let mut cdr = CdrWriter::new();
    header(&mut cdr, time, name);
    // STATUS_FIX, SERVICE_GPS.
    cdr.u8(0);
    cdr.u16(1);
    cdr.f64s([place.lat_deg, place.lon_deg, place.alt_m]);
    cdr.f64s([c.m11, c.m12, 0.0, c.m21, c.m22, 0.0, 0.0, 0.0, 0.0]);
    // COVARIANCE_TYPE_UNKNOWN is 0, COVARIANCE_TYPE_KNOWN 3.
    cdr.u8(if covariance.is_some() { 3 } else { 0 });
    cdr.into_bytes()
}

/// A `tf2_msgs/TFMessage` of one transform.
fn transform(time: f64, of: &Transform<'_>) -> Vec<u8> {
    let mut cdr = CdrWriter::new();
    cdr.length(1);
    header(&mut cdr, time, of.parent);
    cdr.text(of.child);
    cdr.f64s(of.place.iter().copied());
    // x, y, z and w, as ROS has them.
    cdr.f64s(of.turn.coords.iter().copied());
    cdr.into_bytes()
}

fn messages(overview: &Overview, frame: &LocalFrame) -> Result<Vec<Message>, ExportError> {
    let epoch = overview.epoch_unix_s.unwrap_or(0.0);
    let [first, last] = overview.span().map(|time| epoch + time);
    let mut messages = Vec::new();
    let mut add = |time: f64, topic: &str, kind: &'static str, name: &str, data: Vec<u8>| {
        let topic = topic.to_owned();
        let name = name.to_owned();
        messages.push(Message { time, topic, kind, name, data });
    };
    let axes: Matrix3<f64> = frame.axes().transpose();
    let on_earth = Transform {
        parent: EARTH,
        child: MAP,
        place: frame.origin().to_ecef(),
        turn: UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)),
    };
    add(first, "/tf_static", TF_MESSAGE, "", transform(first, &on_earth));
    for (index, receiver) in overview.receivers.iter().enumerate() {
        let child = format!("drone_{index}");
        let topic = |what: &str| format!("/foxhunt/{child}/{what}");
        for knot in &receiver.path {
            let time = epoch + knot.time;
            let name = &receiver.name;
            let mut cdr = CdrWriter::new();
            pose_stamped(&mut cdr, time, &knot.place);
            add(time, &topic("pose"), POSE_STAMPED, name, cdr.into_bytes());
            let data = fix(frame, time, &child, &knot.place, None);
            add(time, &topic("fix"), NAV_SAT_FIX, name, data);
            let turn = UnitQuaternion::identity();
            let of = Transform { parent: MAP, child: &child, place: knot.place, turn };
            add(time, "/tf", TF_MESSAGE, "", transform(time, &of));
        }
        // The last path is the whole one.
        let knots = receiver.path.len();
        for part in 1..=PATHS.min(knots) {
            let end = knots * part / PATHS.min(knots);
            let flown = receiver.path.get(..end).unwrap_or_default();
            if let (Some(data), Some(knot)) = (path(epoch, flown), flown.last()) {
                add(epoch + knot.time, &topic("path"), PATH, &receiver.name, data);
            }
        }
    }
    for received in &overview.received {
        if let Some(bearing) = received.bearing {
            let parent = format!("drone_{}", received.receiver);
            let child = format!("{parent}/antenna");
            // x points where the turn received the beacon.
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), bearing.angle);
            let of = Transform { parent: &parent, child: &child, place: Vector3::zeros(), turn };
            let time = epoch + received.time;
            add(time, "/tf", TF_MESSAGE, "", transform(time, &of));
        }
    }
    for (index, search) in overview.searches.iter().enumerate() {
        let child = format!("beacon_{index}");
        let topic = |what: &str| format!("/foxhunt/{child}/{what}");
        for believed in &search.beliefs {
            let time = epoch + believed.time;
            let place = believed.estimate.mean.push(0.0);
            let covariance = believed.estimate.covariance;
            let data = estimate(time, &place, &covariance);
            add(time, &topic("estimate"), POSE_WITH_COVARIANCE_STAMPED, &search.name, data);
            let data = fix(frame, time, &child, &place, Some(covariance));
            add(time, &topic("fix"), NAV_SAT_FIX, &search.name, data);
            let turn = UnitQuaternion::identity();
            let of = Transform { parent: MAP, child: &child, place, turn };
            add(time, "/tf", TF_MESSAGE, "", transform(time, &of));
        }
    }
    for notice in &overview.notices {
        let time = epoch + notice.time;
        let mut cdr = CdrWriter::new();
        stamp(&mut cdr, time);
        // 10 is debug, 20 is info.
        cdr.u8(if notice.important { 20 } else { 10 });
        cdr.text("foxhunt");
        cdr.text(&notice.text);
        // File, function and line of a program: there are none for an event.
        cdr.text("");
        cdr.text("");
        cdr.u32(0);
        add(time, "/foxhunt/log", LOG, "", cdr.into_bytes());
    }
    let map = geojson(overview, frame);
    let mut cdr = CdrWriter::new();
    cdr.text(&document::to_json(&map).map_err(ExportError::write)?);
    add(last, "/foxhunt/map", GEO_JSON, "", cdr.into_bytes());
    Ok(messages)
}

const GEO_JSON: &str = "foxglove_msgs/msg/GeoJSON";
const LOG: &str = "rcl_interfaces/msg/Log";
const NAV_SAT_FIX: &str = "sensor_msgs/msg/NavSatFix";
const PATH: &str = "nav_msgs/msg/Path";
const POSE_STAMPED: &str = "geometry_msgs/msg/PoseStamped";
const POSE_WITH_COVARIANCE_STAMPED: &str = "geometry_msgs/msg/PoseWithCovarianceStamped";
const TF_MESSAGE: &str = "tf2_msgs/msg/TFMessage";

/// Types with their fields; a type stands after the types that it holds.
const FIELDS: [(&str, &str); 17] = [
    ("builtin_interfaces/msg/Time", "int32 sec\nuint32 nanosec\n"),
    ("std_msgs/msg/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    ("geometry_msgs/msg/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/msg/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/msg/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"),
    (
        "geometry_msgs/msg/Pose",
        "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    ),
    (POSE_STAMPED, "std_msgs/Header header\ngeometry_msgs/Pose pose\n"),
    ("geometry_msgs/msg/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance\n"),
    (
        POSE_WITH_COVARIANCE_STAMPED,
        "std_msgs/Header header\ngeometry_msgs/PoseWithCovariance pose\n",
    ),
    (PATH, "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n"),
    (
        "geometry_msgs/msg/Transform",
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
    ),
    (
        "geometry_msgs/msg/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
    ),
    (TF_MESSAGE, "geometry_msgs/TransformStamped[] transforms\n"),
    ("sensor_msgs/msg/NavSatStatus", "int8 status\nuint16 service\n"),
    (
        NAV_SAT_FIX,
        "std_msgs/Header header\nsensor_msgs/NavSatStatus status\nfloat64 latitude\n\
         float64 longitude\nfloat64 altitude\nfloat64[9] position_covariance\n\
         uint8 position_covariance_type\n",
    ),
    (
        LOG,
        "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\n\
         string function\nuint32 line\n",
    ),
    (GEO_JSON, "string geojson\n"),
];

/// The definition of a type as MCAP wants it (`ros2msg`): its fields, then each type that it holds
/// behind a line of `=`.
fn definition(kind: &str) -> String {
    let fields = |kind: &str| {
        FIELDS.iter().find(|(name, _)| *name == kind).map_or("", |(_, fields)| *fields)
    };
    let mut text = fields(kind).to_owned();
    let mut held: Vec<String> = Vec::new();
    let mut open = vec![kind.to_owned()];
    while let Some(kind) = open.pop() {
        for field in fields(&kind).lines() {
            let of = field.split([' ', '[']).next().unwrap_or_default();
            let of = of.replace('/', "/msg/");
            if of.contains('/') && !held.contains(&of) {
                open.push(of.clone());
                held.push(of);
            }
        }
    }
    for kind in held {
        text.push_str(&"=".repeat(80));
        text.push_str(&format!("\nMSG: {}\n{}", kind.replace("/msg/", "/"), fields(&kind)));
    }
    text
}

/// Writes the values of a message in CDR, as ROS 2 reads it: OMG's Common Data Representation,
/// version 1, little-endian, where each number is aligned to its own size.
#[derive(Debug)]
struct CdrWriter(Vec<u8>);

/// Length of the header; alignment counts from its end.
const HEADER: usize = 4;

impl CdrWriter {
    /// A message that has its header alone.
    fn new() -> Self {
        Self(vec![0, 1, 0, 0])
    }

    fn put<const N: usize>(&mut self, bytes: [u8; N]) {
        let end = self.0.len() - HEADER;
        self.0.resize(HEADER + end.next_multiple_of(N), 0);
        self.0.extend(bytes);
    }

    fn u8(&mut self, value: u8) {
        self.put([value]);
    }

    fn u16(&mut self, value: u16) {
        self.put(value.to_le_bytes());
    }

    fn u32(&mut self, value: u32) {
        self.put(value.to_le_bytes());
    }

    fn f64s(&mut self, values: impl IntoIterator<Item = f64>) {
        for value in values {
            self.put(value.to_le_bytes());
        }
    }

    /// Writes the length of a list, whose items follow.
    fn length(&mut self, items: usize) {
        self.u32(u32::try_from(items).unwrap_or(u32::MAX));
    }

    /// Writes a text; it ends at its first zero byte, which CDR has no room for.
    fn text(&mut self, text: &str) {
        let text = text.split('\0').next().unwrap_or_default();
        self.length(text.len() + 1);
        self.0.extend(text.as_bytes());
        self.u8(0);
    }

    fn into_bytes(self) -> Vec<u8> {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_to_their_size() {
        let mut cdr = CdrWriter::new();
        cdr.u8(7);
        cdr.u32(0x0102_0304);
        cdr.f64s([1.5]);
        cdr.text("a\0b");
        cdr.u16(9);
        let header = [0, 1, 0, 0];
        let numbers = [7, 0, 0, 0, 4, 3, 2, 1, 0, 0, 0, 0, 0, 0, 0xF8, 0x3F];
        let text_and_number = [2, 0, 0, 0, b'a', 0, 9, 0];
        assert_eq!(cdr.into_bytes(), [&header[..], &numbers, &text_and_number].concat());
    }
}
