use std::fmt;

use super::{
    Header, Kept, Opened, Ros2Config,
    node::{Listener, Speaker},
};
use crate::link::{DroneLink, LinkError, Order, Report, ros};

/// A drone's end of a link over ROS 2: `/foxhunt/drone_<n>/` with `pose`, `status` and `reception`
/// out, and `order` in.
pub struct Ros2Drone {
    drone: usize,
    pose: Speaker<ros::PoseStamped<Header>>,
    status: Speaker<ros::Status<Header>>,
    reception: Speaker<ros::Reception<Header>>,
    order: Listener<ros::Order<Header>>,
    _node: Opened,
}

impl fmt::Debug for Ros2Drone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Ros2Drone").field("drone", &self.drone).finish_non_exhaustive()
    }
}

impl Ros2Drone {
    /// Joins the network as a drone, counted from 0.
    ///
    /// # Errors
    ///
    /// [`LinkError::Open`] names what could not be set up.
    pub fn join(config: Ros2Config, drone: usize) -> Result<Self, LinkError> {
        let mut node = Opened::join(config, &format!("drone_{drone}"))?;
        let topic = |what| ros::drone_topic(drone, what);
        let few = Kept::Nothing(1);
        Ok(Self {
            drone,
            pose: node.speaker(&topic("pose"), ("geometry_msgs", "PoseStamped"), few)?,
            status: node.speaker(&topic("status"), ("foxhunt_msgs", "Status"), few)?,
            reception: node.speaker(
                &topic("reception"),
                ("foxhunt_msgs", "Reception"),
                Kept::Nothing(100),
            )?,
            order: node.listener(&topic("order"), ("foxhunt_msgs", "Order"), 10)?,
            _node: node,
        })
    }
}

impl DroneLink for Ros2Drone {
    fn send(&mut self, report: &Report) -> Result<(), LinkError> {
        match report {
            Report::Pose { at, pose } => self.pose.say(ros::pose_message(*at, pose)?),
            Report::Status { at, order, failure } => {
                self.status.say(ros::status_message(*at, *order, failure)?)
            }
            Report::Delivery(delivery) => self.reception.say(ros::reception_message(delivery)?),
        }
    }

    fn receive(&mut self) -> Result<Option<Order>, LinkError> {
        Ok(self.order.hear()?.map(|message| ros::order(&message)))
    }
}
