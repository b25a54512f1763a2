//! What is said over ROS 1 and ROS 2 alike: topics and messages, which differ in their headers alone.

mod convert;
mod messages;
mod show;
mod topics;

pub(super) use convert::{
    delivery, order, order_message, pose_message, reception_message, report_of_pose,
    report_of_status, status_message,
};
pub(super) use messages::{
    DiagnosticArray, FRAME, Order, Path, PoseStamped, PoseWithCovarianceStamped, Reception,
    RosHeader, Status,
};
pub(super) use show::{diagnostics, estimate, goal, path};
pub(super) use topics::{DIAGNOSTICS, beacon_topic, drone_topic};
