//! Messages as they lie in the stream, in the order of their fields: `geometry_msgs`, `nav_msgs`,
//! `diagnostic_msgs`, `std_msgs`, and `foxhunt_msgs` of `hardware/ros`.

use std::fmt::Debug;

use serde::{Deserialize, Deserializer, Serialize, de::DeserializeOwned};

use crate::link::{LinkError, UnixTime};

/// `std_msgs/Header`, of ROS 1 or ROS 2.
pub(in crate::link) trait RosHeader:
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

/// The whole seconds of a moment, in a header's number.
///
/// # Errors
///
/// For a moment that the number does not hold.
pub(in crate::link) fn seconds<T: TryFrom<i64>>(
    field: &'static str,
    moment: UnixTime,
) -> Result<T, LinkError> {
    let UnixTime { sec, .. } = moment;
    T::try_from(sec).map_err(|_| LinkError::Value { field, value: sec.to_string() })
}

/// The hunt's frame: East, North and Up.
pub(in crate::link) const FRAME: &str = "map";

/// `geometry_msgs/Point`: East, North and Up in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::link) struct Point {
    pub(in crate::link) x: f64,
    pub(in crate::link) y: f64,
    pub(in crate::link) z: f64,
}

/// `geometry_msgs/Quaternion`: of the axes forward, left and up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::link) struct Quaternion {
    pub(in crate::link) x: f64,
    pub(in crate::link) y: f64,
    pub(in crate::link) z: f64,
    pub(in crate::link) w: f64,
}

/// `geometry_msgs/Pose`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::link) struct Pose {
    pub(in crate::link) position: Point,
    pub(in crate::link) orientation: Quaternion,
}

/// `geometry_msgs/PoseStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::link) struct PoseStamped<H> {
    pub(in crate::link) header: H,
    pub(in crate::link) pose: Pose,
}

/// `geometry_msgs/PoseWithCovariance`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::link) struct PoseWithCovariance {
    pub(in crate::link) pose: Pose,
    /// Rows of East, North, Up and three rotations.
    pub(in crate::link) covariance: [[f64; 6]; 6],
}

/// `geometry_msgs/PoseWithCovarianceStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::link) struct PoseWithCovarianceStamped<H> {
    pub(in crate::link) header: H,
    pub(in crate::link) pose: PoseWithCovariance,
}

/// `nav_msgs/Path`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::link) struct Path<H> {
    pub(in crate::link) header: H,
    pub(in crate::link) poses: Vec<PoseStamped<H>>,
}

/// `diagnostic_msgs/KeyValue`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::link) struct KeyValue {
    pub(in crate::link) key: String,
    pub(in crate::link) value: String,
}

/// `diagnostic_msgs/DiagnosticStatus`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::link) struct DiagnosticStatus {
    /// 0 sound, 1 a warning.
    pub(in crate::link) level: u8,
    pub(in crate::link) name: String,
    pub(in crate::link) message: String,
    pub(in crate::link) hardware_id: String,
    pub(in crate::link) values: Vec<KeyValue>,
}

/// `diagnostic_msgs/DiagnosticArray`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::link) struct DiagnosticArray<H> {
    pub(in crate::link) header: H,
    pub(in crate::link) status: Vec<DiagnosticStatus>,
}

/// `std_msgs/String`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::link) struct Text {
    pub(in crate::link) data: String,
}

/// `foxhunt_msgs/Reception`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::link) struct Reception<H> {
    pub(in crate::link) header: H,
    pub(in crate::link) beacon: u16,
    pub(in crate::link) heard: bool,
    pub(in crate::link) reason: String,
    pub(in crate::link) position: Point,
    pub(in crate::link) heading: f64,
    pub(in crate::link) pitch: f64,
    pub(in crate::link) roll: f64,
    pub(in crate::link) position_sigma: Vec<f64>,
    pub(in crate::link) rss_dbm: f64,
    pub(in crate::link) rss_sigma_db: f64,
    pub(in crate::link) has_bearing: bool,
    pub(in crate::link) bearing: f64,
    pub(in crate::link) bearing_sigma: f64,
    pub(in crate::link) bearing_confidence: f64,
    pub(in crate::link) covariance: f64,
    pub(in crate::link) mode_weights: Vec<f64>,
    pub(in crate::link) mode_bearings: Vec<f64>,
    pub(in crate::link) mode_sigmas: Vec<f64>,
    #[serde(deserialize_with = "or_empty")]
    pub(in crate::link) velocity: Vec<f64>,
    #[serde(deserialize_with = "or_empty")]
    pub(in crate::link) quantity_names: Vec<String>,
    #[serde(deserialize_with = "or_empty")]
    pub(in crate::link) quantity_values: Vec<f64>,
    #[serde(deserialize_with = "or_empty")]
    pub(in crate::link) quantity_sigmas: Vec<f64>,
}

/// A list at the end of a message, empty where an older sender's message ends before it.
fn or_empty<'de, D: Deserializer<'de>, T: Deserialize<'de>>(of: D) -> Result<Vec<T>, D::Error> {
    Ok(Vec::deserialize(of).unwrap_or_default())
}

/// `foxhunt_msgs/Order`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::link) struct Order<H> {
    pub(in crate::link) header: H,
    pub(in crate::link) number: u64,
    pub(in crate::link) has_goal: bool,
    pub(in crate::link) goal: Point,
    pub(in crate::link) land: bool,
    pub(in crate::link) turn: u64,
    pub(in crate::link) beacons: Vec<u16>,
    pub(in crate::link) taken_beacons: Vec<u16>,
    pub(in crate::link) taken_sec: Vec<i64>,
    pub(in crate::link) taken_nanosec: Vec<u32>,
    pub(in crate::link) take_off: bool,
    pub(in crate::link) leave: u8,
    pub(in crate::link) echo_sec: Vec<i64>,
    pub(in crate::link) echo_nanosec: Vec<u32>,
}

/// `foxhunt_msgs/Status`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::link) struct Status<H> {
    pub(in crate::link) header: H,
    pub(in crate::link) order: u64,
    pub(in crate::link) failure: String,
    pub(in crate::link) stage: u8,
    pub(in crate::link) sent_sec: i64,
    pub(in crate::link) sent_nanosec: u32,
    pub(in crate::link) clock: Vec<f64>,
}
