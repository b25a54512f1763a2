//! Messages of a link and what they are in ROS.

use foxhunt_core::{BeaconId, Bearing, BearingMode, BearingModes, Pose, Reception, Waypoint};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::messages::{self as ros, RosHeader};
use crate::link::{Delivery, LinkError, Order, Report, Taken, Turn, UnixTime};

pub(super) fn point(place: &Vector3<f64>) -> ros::Point {
    ros::Point { x: place.x, y: place.y, z: place.z }
}

fn place(point: &ros::Point) -> Vector3<f64> {
    Vector3::new(point.x, point.y, point.z)
}

/// A pose as ROS has it: a nose that is up is a negative turn about the axis to the left.
pub(super) fn ros_pose(pose: &Pose) -> ros::Pose {
    let turn = UnitQuaternion::from_euler_angles(pose.roll, -pose.pitch, pose.heading);
    let orientation = ros::Quaternion { x: turn.i, y: turn.j, z: turn.k, w: turn.w };
    ros::Pose { position: point(&pose.position), orientation }
}

fn pose(ros: &ros::Pose) -> Pose {
    let ros::Quaternion { x, y, z, w } = ros.orientation;
    // All zeros is what is sent by those who do not know their attitude.
    let turn = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6).unwrap_or_default();
    let (roll, pitch, heading) = turn.euler_angles();
    Pose { position: place(&ros.position), heading, pitch: -pitch, roll }
}

pub(in crate::link) fn pose_message<H: RosHeader>(
    at: UnixTime,
    pose: &Pose,
) -> Result<ros::PoseStamped<H>, LinkError> {
    Ok(ros::PoseStamped { header: H::at(at)?, pose: ros_pose(pose) })
}

pub(in crate::link) fn report_of_pose<H: RosHeader>(message: &ros::PoseStamped<H>) -> Report {
    Report::Pose { at: message.header.moment(), pose: pose(&message.pose) }
}

pub(in crate::link) fn status_message<H: RosHeader>(
    at: UnixTime,
    order: u64,
    failure: &str,
) -> Result<ros::Status<H>, LinkError> {
    Ok(ros::Status { header: H::at(at)?, order, failure: failure.to_owned() })
}

pub(in crate::link) fn report_of_status<H: RosHeader>(message: ros::Status<H>) -> Report {
    let ros::Status { header, order, failure } = message;
    Report::Status { at: header.moment(), order, failure }
}

pub(in crate::link) fn reception_message<H: RosHeader>(
    delivery: &Delivery,
) -> Result<ros::Reception<H>, LinkError> {
    let (header, beacon) = (H::at(delivery.ended)?, delivery.beacon.0);
    let heard = match &delivery.heard {
        Ok(heard) => heard,
        Err(reason) => {
            let reason = reason.clone();
            return Ok(ros::Reception { header, beacon, reason, ..ros::Reception::default() });
        }
    };
    let bearing = heard.bearing.unwrap_or(Bearing { angle: 0.0, sigma: 0.0, confidence: 0.0 });
    let modes = |of: fn(&BearingMode) -> f64| heard.modes.as_slice().iter().map(of).collect();
    Ok(ros::Reception {
        header,
        beacon,
        heard: true,
        reason: String::new(),
        position: point(&heard.receiver.position),
        heading: heard.receiver.heading,
        pitch: heard.receiver.pitch,
        roll: heard.receiver.roll,
        position_sigma: heard.receiver_sigma_m.iter().flatten().copied().collect(),
        rss_dbm: heard.rss_dbm,
        rss_sigma_db: heard.rss_sigma_db,
        has_bearing: heard.bearing.is_some(),
        bearing: bearing.angle,
        bearing_sigma: bearing.sigma,
        bearing_confidence: bearing.confidence,
        covariance: heard.covariance,
        mode_weights: modes(|mode| mode.weight),
        mode_bearings: modes(|mode| mode.angle),
        mode_sigmas: modes(|mode| mode.sigma),
    })
}

/// What a message delivers; a reception that is none says why.
pub(in crate::link) fn delivery<H: RosHeader>(message: ros::Reception<H>) -> Delivery {
    let (beacon, ended) = (BeaconId(message.beacon), message.header.moment());
    let heard = if message.heard { reception(&message) } else { Err(message.reason) };
    Delivery { beacon, ended, heard }
}

fn reception<H>(message: &ros::Reception<H>) -> Result<Reception, String> {
    let ros::Reception { mode_weights, mode_bearings, mode_sigmas, .. } = message;
    let competing = mode_weights.len();
    if mode_bearings.len() != competing || mode_sigmas.len() != competing {
        return Err(format!(
            "{competing} mode_weights, {} mode_bearings and {} mode_sigmas",
            mode_bearings.len(),
            mode_sigmas.len()
        ));
    }
    let modes = mode_weights.iter().zip(mode_bearings).zip(mode_sigmas);
    let modes: Vec<BearingMode> =
        modes.map(|((&weight, &angle), &sigma)| BearingMode { weight, angle, sigma }).collect();
    let receiver_sigma_m = match message.position_sigma[..] {
        [] => None,
        [east, north, up] => Some(Vector3::new(east, north, up)),
        ref other => return Err(format!("position_sigma has {} numbers, not 3", other.len())),
    };
    let bearing = Bearing {
        angle: message.bearing,
        sigma: message.bearing_sigma,
        confidence: message.bearing_confidence,
    };
    Ok(Reception {
        beacon: BeaconId(message.beacon),
        // Seconds of whoever reads it: see `Delivery`.
        time: 0.0,
        receiver: Pose {
            position: place(&message.position),
            heading: message.heading,
            pitch: message.pitch,
            roll: message.roll,
        },
        rss_dbm: message.rss_dbm,
        rss_sigma_db: message.rss_sigma_db,
        bearing: message.has_bearing.then_some(bearing),
        covariance: message.covariance,
        modes: BearingModes::new(&modes).map_err(|error| error.to_string())?,
        receiver_sigma_m,
    })
}

pub(in crate::link) fn order_message<H: RosHeader>(
    order: &Order,
) -> Result<ros::Order<H>, LinkError> {
    Ok(ros::Order {
        header: H::at(order.at)?,
        number: order.number,
        has_goal: order.goal.is_some(),
        goal: order.goal.map_or_else(ros::Point::default, |goal| point(&goal.position)),
        land: order.land,
        turn: order.turn.number,
        beacons: order.turn.beacons.iter().map(|beacon| beacon.0).collect(),
        taken_beacons: order.taken.iter().map(|taken| taken.beacon.0).collect(),
        taken_sec: order.taken.iter().map(|taken| taken.ended.sec).collect(),
        taken_nanosec: order.taken.iter().map(|taken| taken.ended.nanosec).collect(),
    })
}

/// The order of a message; a goal that is no place is none, and what is said of half a delivery is
/// not said.
pub(in crate::link) fn order<H: RosHeader>(message: &ros::Order<H>) -> Order {
    let position = place(&message.goal);
    let is_place = message.has_goal && position.iter().all(|metres| metres.is_finite());
    let times = message.taken_sec.iter().zip(&message.taken_nanosec);
    let taken = message.taken_beacons.iter().zip(times).map(|(&beacon, (&sec, &nanosec))| Taken {
        beacon: BeaconId(beacon),
        ended: UnixTime { sec, nanosec },
    });
    Order {
        at: message.header.moment(),
        number: message.number,
        goal: is_place.then_some(Waypoint { position }),
        land: message.land,
        turn: Turn {
            number: message.turn,
            beacons: message.beacons.iter().copied().map(BeaconId).collect(),
        },
        taken: taken.collect(),
    }
}
