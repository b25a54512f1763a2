use foxhunt_core::Pose;
use foxhunt_wire::mavlink::{
    Autopilot, CommonFrame, degrees_of_e7,
    dialect::{MavFrame, MavMessage, PositionTargetTypemask, SET_POSITION_TARGET_GLOBAL_INT_DATA},
    e7_of_degrees, heading_of_yaw, ned_of_enu, whole, yaw_of_heading,
};
use nalgebra::Vector3;

use super::{
    Telemetry,
    phase::{Goal, Nose},
    reports::Timed,
};

/// Velocities, accelerations and the yaw rate are not given: place and yaw are (0x9F8).
const PLACE_AND_YAW: u16 = 0x9F8;

/// The yaw rate instead of the yaw.
const PLACE_AND_RATE: u16 = 0x5F8;

/// The longest time over which a message is carried forward, in seconds.
const MOST_FORWARD_S: f64 = 0.5;

/// Distance over ground below which the autopilot's own target is the goal, in metres.
pub(super) const SAME_M: f64 = 1.0;

/// Difference in height below which it is, in metres: from a quarter of a metre on a hunt's goals
/// do not count as reached.
pub(super) const SAME_UP_M: f64 = 0.3;

/// Longest time between two reports of one estimator that are compared, in seconds.
const PAIRED_S: f64 = 0.5;

/// The message that orders a goal; `None` while the height of the launch place is unknown.
///
/// ArduPilot takes heights above its launch place. PX4 converts that frame with a wrong sign, by
/// `home.alt - target.alt - ref_alt`, from 2021 to 2026: the vehicle flies twice the height of the
/// reference above home too high. It is sent heights above sea level, in the terms of the altitudes
/// that it reports itself.
pub(super) fn message(
    frame: &CommonFrame,
    goal: &Goal,
    telemetry: &Telemetry,
    now: f64,
) -> Option<MavMessage> {
    let (target_system, target_component, autopilot) = telemetry.who?;
    let (lat_deg, lon_deg) = frame.to_degrees(&goal.place);
    let (mask, yaw, yaw_rate) = match goal.nose {
        Nose::Holds(heading) => (PLACE_AND_YAW, yaw_of_heading(heading), 0.0),
        // Clockwise is positive there.
        Nose::Turns(rate) => (PLACE_AND_RATE, 0.0, -rate),
    };
    #[expect(deprecated, reason = "older firmware knows no other frames")]
    let (coordinate_frame, alt) = match autopilot {
        Autopilot::ArduPilot => (MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, goal.place.z),
        Autopilot::Px4 => (MavFrame::MAV_FRAME_GLOBAL_INT, goal.place.z + launch_alt(telemetry)?),
    };
    #[expect(clippy::cast_possible_truncation, reason = "the messages have no more digits")]
    let [alt, yaw, yaw_rate] = [alt as f32, yaw as f32, yaw_rate as f32];
    Some(MavMessage::SET_POSITION_TARGET_GLOBAL_INT(SET_POSITION_TARGET_GLOBAL_INT_DATA {
        time_boot_ms: whole(now.max(0.0) * 1e3).unsigned_abs(),
        lat_int: e7_of_degrees(lat_deg),
        lon_int: e7_of_degrees(lon_deg),
        alt,
        yaw,
        yaw_rate,
        type_mask: PositionTargetTypemask::from_bits_retain(mask),
        target_system,
        target_component,
        coordinate_frame,
        ..SET_POSITION_TARGET_GLOBAL_INT_DATA::default()
    }))
}

/// Reported target of the autopilot itself, in the common frame, with an Up above its launch
/// place. Components that it was given no target of are not finite.
///
/// PX4's POSITION_TARGET_GLOBAL_INT holds the target of its own modes, in OFFBOARD an old one; its
/// POSITION_TARGET_LOCAL_NED holds the present target, and counts from the zero of its estimator.
/// That zero is found by its place, which it reports in both frames.
pub(super) fn target(
    frame: &CommonFrame,
    telemetry: &Telemetry,
    goal: &Goal,
) -> Option<Timed<Vector3<f64>>> {
    match telemetry.autopilot() {
        Autopilot::ArduPilot => {
            let Timed { at, value } = telemetry.target.as_ref()?;
            let alt = f64::from(value.alt);
            // Above sea level; above the launch place with some firmware.
            let ups = [alt - launch_alt(telemetry)?, alt];
            let away = |up: &f64| (up - goal.place.z).abs();
            let up = ups.into_iter().min_by(|a, b| away(a).total_cmp(&away(b)))?;
            let value =
                frame.to_local(degrees_of_e7(value.lat_int), degrees_of_e7(value.lon_int), up);
            Some(Timed { at: *at, value })
        }
        Autopilot::Px4 => {
            let Timed { at, value: target } = telemetry.local_target.as_ref()?;
            let (here, local) =
                (&telemetry.position.as_ref()?.value, &telemetry.local.as_ref()?.value);
            let apart_s = (f64::from(here.time_boot_ms) - f64::from(local.time_boot_ms)) * 1e-3;
            let enu = |x: f32, y: f32, z: f32| ned_of_enu(&Vector3::new(x, y, z).map(f64::from));
            let place = frame.to_local(
                degrees_of_e7(here.lat),
                degrees_of_e7(here.lon),
                f64::from(here.relative_alt) * 1e-3,
            );
            let then = enu(local.x, local.y, local.z) + enu(local.vx, local.vy, local.vz) * apart_s;
            let value = place + enu(target.x, target.y, target.z) - then;
            (apart_s.abs() <= PAIRED_S).then_some(Timed { at: *at, value })
        }
    }
}

/// Height of the launch place above sea level in the terms of the altitudes that the autopilot
/// reports, in metres: PX4's HOME_POSITION keeps the altitude of the time at which it was set, from
/// which the reference of its estimator may drift away.
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

/// Returns its pose at the time `now`: carried forward from its report, over half a second at most.
pub(super) fn pose(frame: &CommonFrame, telemetry: &Telemetry, now: f64) -> Option<Pose> {
    let position = telemetry.position.as_ref()?;
    let attitude = telemetry.attitude.as_ref()?;
    let since = |at: f64| (now - at).clamp(0.0, MOST_FORWARD_S);
    let place = frame.to_local(
        degrees_of_e7(position.value.lat),
        degrees_of_e7(position.value.lon),
        f64::from(position.value.relative_alt) * 1e-3,
    );
    let Timed { at, value: attitude } = attitude;
    let roll = f64::from(attitude.roll);
    let pitch = f64::from(attitude.pitch);
    let pitching = f64::from(attitude.pitchspeed);
    let turning = f64::from(attitude.yawspeed);
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
