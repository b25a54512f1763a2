use std::fmt;

use super::{Header, Joined, Listener, Ros1Config, Speaker};
use crate::link::{DroneLink, LinkError, Order, Report, ros};

/// A drone's end of a link over ROS 1: `/foxhunt/drone_<n>/` with `pose`, `status` and `reception`
/// out, and `order` in.
pub struct Ros1Drone {
    drone: usize,
    pose: Speaker<ros::PoseStamped<Header>>,
    status: Speaker<ros::Status<Header>>,
    reception: Speaker<ros::Reception<Header>>,
    order: Listener<ros::Order<Header>>,
    _node: Joined,
}

impl fmt::Debug for Ros1Drone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Ros1Drone").field("drone", &self.drone).finish_non_exhaustive()
    }
}

impl Ros1Drone {
    /// Joins the network as a drone, counted from 0; waits for the master's answers.
    ///
    /// # Errors
    ///
    /// [`LinkError::Open`] names what could not be set up.
    pub fn join(config: &Ros1Config, drone: usize) -> Result<Self, LinkError> {
        let node = Joined::join(config, &format!("drone_{drone}"))?;
        let topic = |what| ros::drone_topic(drone, what);
        Ok(Self {
            drone,
            pose: node.speaker(&topic("pose"), false)?,
            status: node.speaker(&topic("status"), false)?,
            reception: node.speaker(&topic("reception"), false)?,
            order: node.listener(&topic("order"))?,
            _node: node,
        })
    }
}

impl DroneLink for Ros1Drone {
    fn send(&mut self, report: &Report) -> Result<(), LinkError> {
        match report {
            Report::Pose { at, pose } => self.pose.say(&ros::pose_message(*at, pose)?),
            Report::Status { at, order, failure } => {
                self.status.say(&ros::status_message(*at, *order, failure)?)
            }
            Report::Delivery(delivery) => self.reception.say(&ros::reception_message(delivery)?),
        }
    }

    fn receive(&mut self) -> Result<Option<Order>, LinkError> {
        Ok(self.order.hear()?.map(|message| ros::order(&message)))
    }
}
