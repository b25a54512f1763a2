use foxhunt_core::Pose;
use foxhunt_wire::mavlink::{
    CommonFrame, degrees_of_e7,
    dialect::{
        MavFrame, MavMessage, POSITION_TARGET_GLOBAL_INT_DATA, PositionTargetTypemask,
        SET_POSITION_TARGET_GLOBAL_INT_DATA,
    },
    e7_of_degrees, heading_of_yaw, ned_of_enu, whole, yaw_of_heading,
};
use nalgebra::Vector3;

use super::{
    phase::{Goal, Nose},
    telemetry::Telemetry,
    timed::Timed,
};

/// Velocities, accelerations and the yaw rate are not given: place and yaw are (0x9F8).
const PLACE_AND_YAW: u16 = 0x9F8;

/// The yaw rate instead of the yaw.
const PLACE_AND_RATE: u16 = 0x5F8;

/// The longest time over which a message is carried forward, in seconds.
const MOST_FORWARD_S: f64 = 0.5;

/// How close the autopilot's own target is to ours when it is the same, in metres.
pub(super) const SAME_M: f64 = 1.0;

/// The message that orders a goal.
pub(super) fn message(frame: &CommonFrame, goal: &Goal, who: (u8, u8), now: f64) -> MavMessage {
    let (lat_deg, lon_deg) = frame.to_degrees(&goal.place);
    let (mask, yaw, yaw_rate) = match goal.nose {
        Nose::Holds(heading) => (PLACE_AND_YAW, yaw_of_heading(heading), 0.0),
        // Clockwise is positive there.
        Nose::Turns(rate) => (PLACE_AND_RATE, 0.0, -rate),
    };
    #[expect(clippy::cast_possible_truncation, reason = "the messages have no more digits")]
    let [alt, yaw, yaw_rate] = [goal.place.z as f32, yaw as f32, yaw_rate as f32];
    #[expect(deprecated, reason = "PX4 takes no other frame with heights above the launch place")]
    let coordinate_frame = MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT;
    MavMessage::SET_POSITION_TARGET_GLOBAL_INT(SET_POSITION_TARGET_GLOBAL_INT_DATA {
        time_boot_ms: whole(now.max(0.0) * 1e3).unsigned_abs(),
        lat_int: e7_of_degrees(lat_deg),
        lon_int: e7_of_degrees(lon_deg),
        alt,
        yaw,
        yaw_rate,
        type_mask: PositionTargetTypemask::from_bits_retain(mask),
        target_system: who.0,
        target_component: who.1,
        coordinate_frame,
        ..SET_POSITION_TARGET_GLOBAL_INT_DATA::default()
    })
}

/// From a goal to the autopilot's own target, in metres. Heights are above sea level there, or
/// above the launch place with some firmware.
pub(super) fn distance_m(
    frame: &CommonFrame,
    goal: &Goal,
    target: &POSITION_TARGET_GLOBAL_INT_DATA,
    launch_alt: f64,
) -> f64 {
    let (lat, lon) = (degrees_of_e7(target.lat_int), degrees_of_e7(target.lon_int));
    let alt = f64::from(target.alt);
    let from = |up: f64| (frame.to_local(lat, lon, up) - goal.place).norm();
    from(alt - launch_alt).min(from(alt))
}

/// Height of the launch place above sea level, in metres.
pub(super) fn launch_alt(telemetry: &Telemetry) -> Option<f64> {
    let position = &telemetry.position.as_ref()?.value;
    Some(f64::from(position.alt - position.relative_alt) * 1e-3)
}

/// East, North and Up in metres per second.
pub(super) fn velocity(telemetry: &Telemetry) -> Vector3<f64> {
    let position =
        telemetry.position.as_ref().map(|position| position.value.clone()).unwrap_or_default();
    let [north, east, down] = [position.vx, position.vy, position.vz].map(|v| f64::from(v) * 0.01);
    ned_of_enu(&Vector3::new(north, east, down))
}

/// Where it is and how it is turned at the time `now`: carried forward from its report, over half
/// a second at most.
pub(super) fn pose(frame: &CommonFrame, telemetry: &Telemetry, now: f64) -> Option<Pose> {
    let (position, attitude) = (telemetry.position.as_ref()?, telemetry.attitude.as_ref()?);
    let since = |at: f64| (now - at).clamp(0.0, MOST_FORWARD_S);
    let place = frame.to_local(
        degrees_of_e7(position.value.lat),
        degrees_of_e7(position.value.lon),
        f64::from(position.value.relative_alt) * 1e-3,
    );
    let Timed { at, value: attitude } = attitude;
    let (roll, pitch) = (f64::from(attitude.roll), f64::from(attitude.pitch));
    let (pitching, turning) = (f64::from(attitude.pitchspeed), f64::from(attitude.yawspeed));
    // Body rates as the rate of the yaw angle; near the vertical there is none.
    let yaw_rate = (roll.sin() * pitching + roll.cos() * turning) / pitch.cos().max(0.1);
    let yaw = f64::from(attitude.yaw) + yaw_rate * since(*at);
    let velocity = velocity(telemetry);
    Some(Pose {
        position: place + velocity * since(position.at),
        heading: heading_of_yaw(yaw),
        pitch,
        roll,
        velocity: Some(velocity),
    })
}
