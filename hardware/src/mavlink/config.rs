use foxhunt_core::parameter::{FieldError, at_least_one, in_range, positive, require};
use foxhunt_wire::mavlink::{Autopilot, SigningKey};
use serde::{Deserialize, Serialize};

use super::FlightLimits;

/// Connection to an autopilot and limits of its flight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MavlinkConfig {
    /// Firmware of the autopilot; where absent, that of its heartbeat.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub autopilot: Option<Autopilot>,
    /// Its system number (SYSID_THISMAV, MAV_SYS_ID); where absent, that of the first autopilot
    /// received.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub system_id: Option<u8>,
    /// Our own (SYSID_MYGCS).
    pub ground_system_id: u8,
    /// The origin of the East-North-Up frame that all drones of a hunt share. Where absent, the
    /// place where this drone first has a good position: for a drone that flies alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin: Option<MavlinkOrigin>,
    /// True if nothing is ever sent to it, no heartbeat and no question either: it is flown by
    /// others, and what it sends them is all that is known of it.
    pub listen_only: bool,
    /// Speed over ground that it is ordered to fly at, in metres per second; as it is set up where
    /// absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cruise_speed_mps: Option<f64>,
    /// True if it has a camera of its own, which takes a picture where one is ordered.
    pub camera: bool,
    /// Distance from the height of take-off within which it takes goals, in metres.
    pub take_off_tolerance_m: f64,
    /// Longest duration of a take-off from the order to climb on, in seconds.
    pub take_off_timeout_s: f64,
    /// Time for which a good position is awaited before take-off, in seconds.
    pub position_timeout_s: f64,
    /// Rate of its position and attitude messages, per second.
    pub pose_rate_hz: f64,
    /// Rate of all other messages, per second.
    pub status_rate_hz: f64,
    /// Rate at which set-points are repeated where they have to be: to PX4, and while it turns; per
    /// second.
    pub setpoint_rate_hz: f64,
    /// Time in seconds without any message after which the link is lost; without a heartbeat twice
    /// as long.
    pub link_timeout_s: f64,
    /// An older place or attitude is an error, in seconds.
    pub pose_timeout_s: f64,
    /// Time for which an answer to an order is awaited, in seconds.
    pub ack_timeout_s: f64,
    /// Number of times that an order is given before it counts as refused.
    pub attempts: u32,
    /// The fastest turn that may be ordered, in degrees per second.
    pub spin_limit_deg_s: f64,
    /// Rate of its turns to a heading, in degrees per second.
    pub turn_rate_deg_s: f64,
    /// Difference from an ordered heading within which it has turned, in degrees.
    pub heading_tolerance_deg: f64,
    /// Limits of the places where it may be sent.
    pub limits: FlightLimits,
    /// Requirements on its position for a take-off.
    pub position: PositionRequirements,
    /// The key of a signed link; unsigned messages are refused then.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub signing: Option<MavlinkSigning>,
}

impl Default for MavlinkConfig {
    /// Any autopilot, our system number 255; its launch place the origin; take-off to within 0.5 m
    /// in 60 s after up to 120 s for a position; pose 10 Hz, status 2 Hz, set-points 5 Hz; the link
    /// lost after 3.5 s, a pose old after 1 s; 5 attempts a second apart; turns up to 90 °/s, to
    /// headings at 30 °/s within 5°; no camera; no signing; orders are sent.
    fn default() -> Self {
        Self {
            autopilot: None,
            system_id: None,
            ground_system_id: 255,
            origin: None,
            listen_only: false,
            cruise_speed_mps: None,
            camera: false,
            take_off_tolerance_m: 0.5,
            take_off_timeout_s: 60.0,
            position_timeout_s: 120.0,
            pose_rate_hz: 10.0,
            status_rate_hz: 2.0,
            setpoint_rate_hz: 5.0,
            link_timeout_s: 3.5,
            pose_timeout_s: 1.0,
            ack_timeout_s: 1.0,
            attempts: 5,
            spin_limit_deg_s: 90.0,
            turn_rate_deg_s: 30.0,
            heading_tolerance_deg: 5.0,
            limits: FlightLimits::default(),
            position: PositionRequirements::default(),
            signing: None,
        }
    }
}

/// Origin of the common frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MavlinkOrigin {
    /// Latitude in degrees, North positive.
    pub lat_deg: f64,
    /// Longitude in degrees, East positive.
    pub lon_deg: f64,
}

/// Requirements on a position for a take-off, besides the autopilot's own estimator flags.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PositionRequirements {
    /// The least fix: 3 in space, 4 differential, 5 RTK float, 6 RTK fixed.
    pub fix_type: u8,
    /// The fewest satellites.
    pub satellites: u8,
    /// The most uncertain place over ground, in metres, where the receiver reports it.
    pub horizontal_accuracy_m: f64,
}

impl Default for PositionRequirements {
    /// A fix in space from 6 satellites, good to 5 m.
    fn default() -> Self {
        Self { fix_type: 3, satellites: 6, horizontal_accuracy_m: 5.0 }
    }
}

/// The key of a signed link (<https://mavlink.io/en/guide/message_signing.html>).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MavlinkSigning {
    /// 64 hexadecimal digits: the SHA-256 of the passphrase that other programs take.
    pub key: SigningKey,
    /// Number of this link among several; each program has another one.
    #[serde(default)]
    pub link_id: u8,
}

impl MavlinkConfig {
    /// Refuses what cannot be flown with.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the field, with its value.
    pub fn check(&self) -> Result<(), FieldError> {
        let positives = [
            ("take_off_tolerance_m", self.take_off_tolerance_m),
            ("take_off_timeout_s", self.take_off_timeout_s),
            ("position_timeout_s", self.position_timeout_s),
            ("status_rate_hz", self.status_rate_hz),
            ("pose_timeout_s", self.pose_timeout_s),
            ("ack_timeout_s", self.ack_timeout_s),
            ("turn_rate_deg_s", self.turn_rate_deg_s),
            ("heading_tolerance_deg", self.heading_tolerance_deg),
            ("spin_limit_deg_s", self.spin_limit_deg_s),
            ("cruise_speed_mps", self.cruise_speed_mps.unwrap_or(1.0)),
            ("position.horizontal_accuracy_m", self.position.horizontal_accuracy_m),
        ];
        for (field, value) in positives {
            positive(field, value)?;
        }
        in_range("pose_rate_hz", self.pose_rate_hz, 1.0..=100.0, "in 1 … 100")?;
        // PX4 leaves OFFBOARD below 2 Hz.
        in_range("setpoint_rate_hz", self.setpoint_rate_hz, 2.5..=50.0, "in 2.5 … 50")?;
        let requirement = "at least 2, as heartbeats come once a second";
        in_range("link_timeout_s", self.link_timeout_s, 2.0..=60.0, requirement)?;
        at_least_one("attempts", self.attempts)?;
        for (field, id) in [
            ("ground_system_id", self.ground_system_id),
            ("system_id", self.system_id.unwrap_or(1)),
        ] {
            require(id > 0, field, f64::from(id), "in 1 … 255")?;
        }
        self.limits.check().map_err(|error| error.within("limits"))
    }
}
