//! Settings of the connection to an autopilot, and limits of its flight.

use foxhunt_core::parameter::{FieldError, as_value, at_least_one, in_range, positive, require};
use foxhunt_wire::mavlink::{Autopilot, SigningKey};
use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::MavlinkError;

/// Distance over ground outside the fence, in metres, beyond which an aircraft is brought back.
const STRAYED_M: f64 = 2.0;

/// Distance outside the limits of height beyond which it is brought back, in metres.
const STRAYED_UP_M: f64 = 1.0;

/// Depth below the least height, in metres, and rate of sinking, in metres per second, from which
/// an aircraft does not fly to any goal of ours.
const SUNK_M: f64 = 0.5;
const SINKS_MPS: f64 = 0.3;

/// Connection to an autopilot and limits of its flight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MavlinkConfig {
    /// Firmware of the autopilot; where absent, that of its heartbeat.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub autopilot: Option<Autopilot>,
    /// System number of the autopilot (SYSID_THISMAV, MAV_SYS_ID); if absent, that of the first
    /// autopilot received.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub system_id: Option<u8>,
    /// Our own (SYSID_MYGCS).
    pub ground_system_id: u8,
    /// The origin of the East-North-Up frame that all drones of a hunt share. Where absent, the
    /// place where this drone first has a good position: for a drone that flies alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin: Option<MavlinkOrigin>,
    /// True if nothing is ever sent to the autopilot, no heartbeat and no question either: others
    /// fly it, and its messages to them are the only source of its state.
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
    /// Limits of the places to which the vehicle may be sent.
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

/// Limits of the places where an aircraft may be sent, whatever its own fence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FlightLimits {
    /// The highest goal, in metres above its launch place.
    pub max_up_m: f64,
    /// The lowest.
    pub min_up_m: f64,
    /// The farthest goal over ground from its launch place, in metres.
    pub fence_radius_m: f64,
    /// Corners of an area, East and North in metres of the common frame, which neither a goal nor
    /// the straight way to it leaves; without corners there is no such area.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fence: Vec<[f64; 2]>,
}

impl Default for FlightLimits {
    /// 2 to 50 m up, 300 m from the launch place.
    fn default() -> Self {
        Self { max_up_m: 50.0, min_up_m: 2.0, fence_radius_m: 300.0, fence: Vec::new() }
    }
}

impl FlightLimits {
    pub(super) fn check(&self) -> Result<(), FieldError> {
        positive("max_up_m", self.max_up_m)?;
        let low = self.min_up_m.is_finite() && self.min_up_m < self.max_up_m;
        require(low, "min_up_m", self.min_up_m, "a number below max_up_m")?;
        let radius = self.fence_radius_m;
        require(radius > 0.0, "fence_radius_m", radius, "a positive number")?;
        for (i, corner) in self.fence.iter().enumerate() {
            if let Some(value) = corner.iter().find(|value| !value.is_finite()) {
                return Err(FieldError::new(format!("fence[{i}]"), value, "finite"));
            }
        }
        let corners = self.fence.len();
        let encloses = corners == 0 || corners > 2;
        require(encloses, "fence", as_value(corners), "at least 3 corners")?;
        Ok(())
    }

    /// Refuses a height.
    pub(super) fn check_up(&self, up_m: f64) -> Result<(), MavlinkError> {
        if (self.min_up_m..=self.max_up_m).contains(&up_m) {
            return Ok(());
        }
        Err(MavlinkError::UpLimit { up_m, min_up_m: self.min_up_m, max_up_m: self.max_up_m })
    }

    /// Refuses a goal for an aircraft that is `from` somewhere and was launched at `launch`.
    pub(super) fn check_goal(
        &self,
        goal: &Vector3<f64>,
        from: Option<&Vector3<f64>>,
        launch: Option<&Vector3<f64>>,
    ) -> Result<(), MavlinkError> {
        let [east_m, north_m, up_m] = (*goal).into();
        if !goal.iter().all(|value| value.is_finite()) {
            return Err(MavlinkError::Goal { east_m, north_m, up_m });
        }
        self.check_up(up_m)?;
        let distance_m = launch.map_or(0.0, |launch| (goal - launch).xy().norm());
        if distance_m > self.fence_radius_m {
            let fence_radius_m = self.fence_radius_m;
            return Err(MavlinkError::Radius { east_m, north_m, distance_m, fence_radius_m });
        }
        if self.fence.is_empty() {
            return Ok(());
        }
        let outside =
            |what| Err(MavlinkError::Fence { what, east_m, north_m, corners: self.fence.len() });
        if !self.contains(goal.xy()) {
            return outside("goal");
        }
        // One that is already outside may come back in on any way.
        match from.map(|from| from.xy()).filter(|from| self.contains(*from)) {
            Some(from) if self.edges().any(|edge| crosses(from, goal.xy(), edge)) => {
                outside("way to")
            }
            _ => Ok(()),
        }
    }

    /// The nearest place that is permitted, and what is wrong with this one, for an aircraft that
    /// is farther outside than it may be by the wind and by what its position is good to.
    pub(super) fn strayed(
        &self,
        place: &Vector3<f64>,
        launch: Option<&Vector3<f64>>,
    ) -> Option<(Vector3<f64>, String)> {
        let mut inside = *place;
        inside.z = inside.z.clamp(self.min_up_m, self.max_up_m);
        if let Some(launch) = launch.map(|launch| launch.xy()) {
            let way = (place.xy() - launch).cap_magnitude(self.fence_radius_m);
            (inside.x, inside.y) = (launch.x + way.x, launch.y + way.y);
        }
        if !self.fence.is_empty() && !self.contains(inside.xy()) {
            let within = |at: &Vector2<f64>| {
                launch.is_none_or(|launch| (at - launch.xy()).norm() <= self.fence_radius_m)
            };
            let away = |at: &Vector2<f64>| (at - place.xy()).norm();
            let nearest = self
                .edges()
                .map(|edge| nearest_on(edge, place.xy()))
                .filter(within)
                .min_by(|a, b| away(a).total_cmp(&away(b)))
                .or(launch.map(|launch| launch.xy()))?;
            (inside.x, inside.y) = (nearest.x, nearest.y);
        }
        let over_ground = (place - inside).xy().norm();
        let up = (place.z - inside.z).abs();
        if over_ground > STRAYED_M {
            return Some((inside, format!("it is {over_ground:.1} m outside the fence")));
        }
        let why = format!(
            "it is {:.1} m up, and the limits are {} to {} m",
            place.z, self.min_up_m, self.max_up_m
        );
        (up > STRAYED_UP_M).then_some((inside, why))
    }

    /// Returns the fault of an aircraft at a height and a rate of sinking, if it is below the
    /// limits and goes on sinking.
    pub(super) fn sinks(&self, up_m: f64, sinks_mps: f64) -> Option<String> {
        let least = self.min_up_m;
        (up_m < least - SUNK_M && sinks_mps > SINKS_MPS).then(|| {
            format!(
                "it sinks at {sinks_mps:.1} m/s, {up_m:.1} m up, and the least height is {least} m"
            )
        })
    }

    fn edges(&self) -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> {
        let corners = self.fence.iter().map(|[east, north]| Vector2::new(*east, *north));
        corners.clone().zip(corners.cycle().skip(1))
    }

    /// Returns true if a place is in the area: a ray to the East leaves it an odd number of times.
    fn contains(&self, place: Vector2<f64>) -> bool {
        let crossed = self.edges().filter(|(a, b)| {
            let spans = (a.y > place.y) != (b.y > place.y);
            spans && place.x < a.x + (place.y - a.y) / (b.y - a.y) * (b.x - a.x)
        });
        crossed.count() % 2 == 1
    }
}

/// The place of an edge that is nearest to another one.
fn nearest_on((a, b): (Vector2<f64>, Vector2<f64>), place: Vector2<f64>) -> Vector2<f64> {
    let edge = b - a;
    let share = (place - a).dot(&edge) / edge.norm_squared().max(f64::MIN_POSITIVE);
    a + edge * share.clamp(0.0, 1.0)
}

/// Returns true if the way from `a` to `b` crosses an edge.
fn crosses(a: Vector2<f64>, b: Vector2<f64>, edge: (Vector2<f64>, Vector2<f64>)) -> bool {
    let side = |p: Vector2<f64>, q: Vector2<f64>, r: Vector2<f64>| (q - p).perp(&(r - p)) > 0.0;
    let (c, d) = edge;
    side(a, b, c) != side(a, b, d) && side(c, d, a) != side(c, d, b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MavlinkConfig;

    #[test]
    fn goals_and_ways_stay_inside() {
        // A square with a notch from the North.
        let fence = vec![
            [0.0, 0.0],
            [40.0, 0.0],
            [40.0, 40.0],
            [25.0, 40.0],
            [20.0, 10.0],
            [15.0, 40.0],
            [0.0, 40.0],
        ];
        let limits = FlightLimits { fence, fence_radius_m: 60.0, ..FlightLimits::default() };
        limits.check().expect("a fence");
        let launch = Vector3::new(5.0, 5.0, 0.0);
        let at = |east, north, up| Vector3::new(east, north, up);
        let check = |goal: Vector3<f64>, from: Vector3<f64>| {
            limits.check_goal(&goal, Some(&from), Some(&launch)).map_err(|error| error.to_string())
        };
        let left = at(10.0, 30.0, 10.0);
        assert_eq!(check(at(5.0, 35.0, 10.0), left), Ok(()));
        assert_eq!(check(at(30.0, 5.0, 10.0), launch), Ok(()));
        assert!(
            check(at(30.0, 30.0, 10.0), left).expect_err("outside").contains("way to (30, 30)")
        );
        assert!(check(at(20.0, 30.0, 10.0), left).expect_err("outside").contains("goal (20, 30)"));
        assert!(check(at(-1.0, 5.0, 10.0), left).expect_err("outside").contains("7 corners"));
        // Back in from the notch.
        assert_eq!(check(at(10.0, 30.0, 10.0), at(20.0, 30.0, 10.0)), Ok(()));
        assert!(check(at(10.0, 30.0, 51.0), left).expect_err("outside").contains("2 to 50 m"));
        assert!(check(at(10.0, 30.0, 1.9), left).expect_err("outside").contains("1.9"));
        assert!(check(at(10.0, f64::NAN, 10.0), left).is_err());
        let radius = FlightLimits { fence_radius_m: 10.0, ..FlightLimits::default() };
        let error = radius.check_goal(&left, None, Some(&launch)).expect_err("outside").to_string();
        assert!(error.contains("25.5 m") && error.contains("fence_radius_m is 10"), "{error}");
    }

    #[test]
    fn who_strays_is_brought_to_the_nearest_permitted_place() {
        let fence = vec![[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0]];
        let limits = FlightLimits { fence_radius_m: 30.0, fence, ..FlightLimits::default() };
        let launch = Vector3::new(5.0, 5.0, 0.0);
        let back = |east, north, up| limits.strayed(&Vector3::new(east, north, up), Some(&launch));
        let close = |a: Vector3<f64>, b: [f64; 3]| (a - Vector3::from(b)).norm() < 1e-9;
        assert_eq!(back(10.0, 10.0, 10.0), None);
        assert_eq!(back(-1.9, 10.0, 10.0), None, "within the margin");
        assert_eq!(back(10.0, 10.0, 50.9), None, "within the margin");
        let (place, why) = back(-2.5, 10.0, 10.0).expect("outside");
        assert!(close(place, [0.0, 10.0, 10.0]) && why.contains("2.5 m outside"), "{place} {why}");
        let (place, _) = back(38.0, 5.0, 60.0).expect("beyond the radius");
        assert!(close(place, [35.0, 5.0, 50.0]), "{place}");
        let (place, why) = back(10.0, 10.0, 0.5).expect("too low");
        assert!(close(place, [10.0, 10.0, 2.0]) && why.contains("0.5 m up"), "{place} {why}");
    }

    #[test]
    fn impossible_limits_are_named() {
        for (limits, field) in [
            (FlightLimits { max_up_m: 0.0, ..FlightLimits::default() }, "limits.max_up_m"),
            (FlightLimits { min_up_m: 60.0, ..FlightLimits::default() }, "limits.min_up_m"),
            (FlightLimits { fence_radius_m: -1.0, ..FlightLimits::default() }, "fence_radius_m"),
            (FlightLimits { fence: vec![[0.0; 2]; 2], ..FlightLimits::default() }, "limits.fence"),
        ] {
            let config = MavlinkConfig { limits, ..MavlinkConfig::default() };
            let error = config.check().expect_err("outside").to_string();
            assert!(error.contains(field), "{error}");
        }
    }
}
