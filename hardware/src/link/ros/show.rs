//! A hunt in messages that every viewer knows.

use foxhunt_core::{Estimate, Waypoint};

use super::{
    convert::{pose_message, ros_pose},
    messages::{
        DiagnosticArray, DiagnosticStatus, KeyValue, Path, Pose, PoseStamped, PoseWithCovariance,
        PoseWithCovarianceStamped, RosHeader,
    },
};
use crate::link::{DroneView, Health, LinkError, UnixTime};

/// The variance of what is not estimated: height and attitude.
const UNKNOWN: f64 = 1e6;

/// Returns the belief about a beacon's place. Its height and attitude are not known.
pub(in crate::link) fn estimate<H: RosHeader>(
    at: UnixTime,
    estimate: &Estimate<2>,
) -> Result<PoseWithCovarianceStamped<H>, LinkError> {
    let at_mean = foxhunt_core::Pose::at(estimate.mean.x, estimate.mean.y, 0.0);
    let mut covariance = [[0.0; 6]; 6];
    for (row, cells) in covariance.iter_mut().enumerate() {
        cells[row] = UNKNOWN;
    }
    for (row, cells) in covariance.iter_mut().take(2).enumerate() {
        for (column, cell) in cells.iter_mut().take(2).enumerate() {
            *cell = estimate.covariance[(row, column)];
        }
    }
    let pose = PoseWithCovariance { pose: ros_pose(&at_mean), covariance };
    Ok(PoseWithCovarianceStamped { header: H::at(at)?, pose })
}

/// Returns the ordered place of a drone.
pub(in crate::link) fn goal<H: RosHeader>(
    at: UnixTime,
    goal: &Waypoint,
) -> Result<PoseStamped<H>, LinkError> {
    pose_message(at, &foxhunt_core::Pose::level(goal.position, 0.0))
}

/// Returns the past path of a drone.
pub(in crate::link) fn path<H: RosHeader>(
    at: UnixTime,
    drone: &DroneView,
) -> Result<Path<H>, LinkError> {
    let poses = drone.path.iter().map(|(at, pose)| {
        let pose: Pose = ros_pose(pose);
        Ok(PoseStamped { header: H::at(*at)?, pose })
    });
    Ok(Path { header: H::at(at)?, poses: poses.collect::<Result<_, LinkError>>()? })
}

/// Returns the health of the drones and of the hunt.
pub(in crate::link) fn diagnostics<H: RosHeader>(
    at: UnixTime,
    health: &[Health],
) -> Result<DiagnosticArray<H>, LinkError> {
    let status = health.iter().map(|health| DiagnosticStatus {
        level: u8::from(health.trouble.is_some()),
        name: health.name.clone(),
        message: health.trouble.as_ref().unwrap_or(&health.doing).clone(),
        hardware_id: "foxhunt".to_owned(),
        values: health
            .values
            .iter()
            .map(|(key, value)| KeyValue { key: key.clone(), value: value.clone() })
            .collect(),
    });
    Ok(DiagnosticArray { header: H::at(at)?, status: status.collect() })
}
