//! Common parts of ROS 1 and ROS 2: topics, messages, which differ in their headers alone, and the
//! two ends of a link.

mod carrier;
mod convert;
mod drone;
mod fusion;
mod messages;
mod node;
mod show;
#[cfg(test)]
mod tests;
mod topics;

pub(super) use drone::DroneEnd;
pub(super) use fusion::FusionEnd;
pub(super) use messages::{
    DiagnosticArray, FRAME, Order, Path, PoseStamped, PoseWithCovarianceStamped, Reception,
    RosHeader, Status, Text, seconds,
};
pub(super) use node::{Kept, Publish, Publisher, Subscribe, Subscriber, Topics};
pub(super) use topics::{DIAGNOSTICS, beacon_topic, drone_name, drone_topic};
