//! Links over ROS 1 and ROS 2, with their common parts: topics, and messages, which differ in their
//! headers alone.
//!
//! The messages are those of `geometry_msgs`, `nav_msgs`, `diagnostic_msgs`, `std_msgs`, and
//! `foxhunt_msgs` of `hardware/ros`, their fields in the order in which they lie in the stream.

mod convert;
mod ends;
#[cfg(feature = "ros1")]
mod ros1;
#[cfg(feature = "ros2")]
mod ros2;
#[cfg(test)]
mod tests;

#[cfg(feature = "ros1")]
pub use ros1::{Ros1Config, Ros1Drone, Ros1Fusion};
#[cfg(feature = "ros2")]
pub use ros2::{Ros2Config, Ros2Drone, Ros2Fusion};

use std::fmt::Debug;

use serde::{Deserialize, Deserializer, Serialize, de::DeserializeOwned};

use super::{LinkError, UnixTime};

/// The hunt's frame: East, North and Up.
const FRAME: &str = "map";

/// The topic of diagnostics, as everywhere in ROS.
const DIAGNOSTICS: &str = "/diagnostics";

/// `std_msgs/Header`, of ROS 1 or ROS 2.
trait RosHeader:
    Clone + Debug + Default + Serialize + DeserializeOwned + Send + Sync + 'static
{
    /// The header of something that was so at a moment, in the hunt's frame.
    ///
    /// # Errors
    ///
    /// For a moment that its seconds do not hold.
    fn at(moment: UnixTime) -> Result<Self, LinkError>;

    /// The moment.
    fn moment(&self) -> UnixTime;
}

/// `geometry_msgs/Point`: East, North and Up in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Point {
    x: f64,
    y: f64,
    z: f64,
}

/// `geometry_msgs/Quaternion`: of the axes forward, left and up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

/// `geometry_msgs/Pose`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Pose {
    position: Point,
    orientation: Quaternion,
}

/// `geometry_msgs/PoseStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct PoseStamped<H> {
    header: H,
    pose: Pose,
}

/// `geometry_msgs/PoseWithCovariance`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct PoseWithCovariance {
    pose: Pose,
    /// Rows of East, North, Up and three rotations.
    covariance: [[f64; 6]; 6],
}

/// `geometry_msgs/PoseWithCovarianceStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct PoseWithCovarianceStamped<H> {
    header: H,
    pose: PoseWithCovariance,
}

/// `nav_msgs/Path`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Path<H> {
    header: H,
    poses: Vec<PoseStamped<H>>,
}

/// `diagnostic_msgs/KeyValue`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct KeyValue {
    key: String,
    value: String,
}

/// `diagnostic_msgs/DiagnosticStatus`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct DiagnosticStatus {
    /// 0 sound, 1 a warning.
    level: u8,
    name: String,
    message: String,
    hardware_id: String,
    values: Vec<KeyValue>,
}

/// `diagnostic_msgs/DiagnosticArray`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct DiagnosticArray<H> {
    header: H,
    status: Vec<DiagnosticStatus>,
}

/// `std_msgs/String`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Text {
    data: String,
}

/// `foxhunt_msgs/Reception`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Reception<H> {
    header: H,
    beacon: u16,
    heard: bool,
    reason: String,
    position: Point,
    heading: f64,
    pitch: f64,
    roll: f64,
    position_sigma: Vec<f64>,
    rss_dbm: f64,
    rss_sigma_db: f64,
    has_bearing: bool,
    bearing: f64,
    bearing_sigma: f64,
    bearing_confidence: f64,
    covariance: f64,
    mode_weights: Vec<f64>,
    mode_bearings: Vec<f64>,
    mode_sigmas: Vec<f64>,
    #[serde(deserialize_with = "or_empty")]
    velocity: Vec<f64>,
    #[serde(deserialize_with = "or_empty")]
    quantity_names: Vec<String>,
    #[serde(deserialize_with = "or_empty")]
    quantity_values: Vec<f64>,
    #[serde(deserialize_with = "or_empty")]
    quantity_sigmas: Vec<f64>,
}

/// `foxhunt_msgs/Order`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Order<H> {
    header: H,
    number: u64,
    has_goal: bool,
    goal: Point,
    land: bool,
    turn: u64,
    beacons: Vec<u16>,
    taken_beacons: Vec<u16>,
    taken_sec: Vec<i64>,
    taken_nanosec: Vec<u32>,
    take_off: bool,
    leave: u8,
    echo_sec: Vec<i64>,
    echo_nanosec: Vec<u32>,
}

/// `foxhunt_msgs/Status`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Status<H> {
    header: H,
    order: u64,
    failure: String,
    stage: u8,
    sent_sec: i64,
    sent_nanosec: u32,
    clock: Vec<f64>,
}

/// Messages that are kept: for slow subscribers, or for late ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kept {
    /// A queue of this length for slow subscribers; late ones get nothing.
    Queue(usize),
    /// The last one, for subscribers that come late.
    Last,
}

/// A topic that messages are published on.
trait Publish<M> {
    /// Publishes a message; nothing is waited for.
    fn publish(&mut self, message: M) -> Result<(), LinkError>;
}

/// A topic that messages come by.
trait Subscribe<M> {
    /// The next message that has come.
    fn take(&mut self) -> Result<Option<M>, LinkError>;
}

/// A publisher of either version of ROS.
type Publisher<M> = Box<dyn Publish<M> + Send>;

/// A subscriber of either version of ROS.
type Subscriber<M> = Box<dyn Subscribe<M> + Send>;

/// A node of the network that makes topics of messages `M`.
trait Topics<M> {
    /// A topic to publish on.
    fn publisher(&mut self, topic: &str, kept: Kept) -> Result<Publisher<M>, LinkError>;

    /// A topic to publish on whose last message is kept. It does not wait for the network: what is
    /// published before the network knows of the topic is lost, and after a [`LinkError::Open`] it
    /// has to be made again.
    fn late_publisher(&mut self, topic: &str) -> Result<Publisher<M>, LinkError>;

    /// A topic to subscribe to, with a queue of `depth` messages.
    fn subscriber(&mut self, topic: &str, depth: usize) -> Result<Subscriber<M>, LinkError>;
}

/// The whole seconds of a moment, in a header's number.
///
/// # Errors
///
/// For a moment that the number does not hold.
fn seconds<T: TryFrom<i64>>(field: &'static str, moment: UnixTime) -> Result<T, LinkError> {
    let UnixTime { sec, .. } = moment;
    T::try_from(sec).map_err(|_| LinkError::Value { field, value: sec.to_string() })
}

/// A list at the end of a message, empty where an older sender's message ends before it.
fn or_empty<'de, D: Deserializer<'de>, T: Deserialize<'de>>(of: D) -> Result<Vec<T>, D::Error> {
    Ok(Vec::deserialize(of).unwrap_or_default())
}

/// The name of a drone's node, counted from 0.
fn drone_name(drone: usize) -> String {
    format!("drone_{drone}")
}

/// A topic of a drone, counted from 0.
fn drone_topic(drone: usize, what: &str) -> String {
    format!("/foxhunt/drone_{drone}/{what}")
}

/// A topic of a beacon, by its number in the hunt's list.
fn beacon_topic(beacon: u16, what: &str) -> String {
    format!("/foxhunt/beacon_{beacon}/{what}")
}
