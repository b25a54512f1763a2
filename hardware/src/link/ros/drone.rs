use std::fmt;

use super::{
    Kept, Order, PoseStamped, Publisher, Reception, RosHeader, Status, Subscriber, Topics, convert,
    drone_topic,
};
use crate::link::{self, DroneLink, LinkError, Report};

/// A drone's end of a link over ROS: `/foxhunt/drone_<n>/` with `pose`, `status` and `reception`
/// out, and `order` in.
pub(in crate::link) struct DroneEnd<H, N> {
    drone: usize,
    pose: Publisher<PoseStamped<H>>,
    status: Publisher<Status<H>>,
    reception: Publisher<Reception<H>>,
    order: Subscriber<Order<H>>,
    /// The topics live no longer than their node.
    _node: N,
}

impl<H, N> fmt::Debug for DroneEnd<H, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DroneEnd").field("drone", &self.drone).finish_non_exhaustive()
    }
}

impl<H, N> DroneEnd<H, N>
where
    N: Topics<PoseStamped<H>> + Topics<Status<H>> + Topics<Reception<H>> + Topics<Order<H>>,
{
    /// The topics of a drone, counted from 0.
    pub(in crate::link) fn new(mut node: N, drone: usize) -> Result<Self, LinkError> {
        let topic = |what| drone_topic(drone, what);
        Ok(Self {
            drone,
            pose: node.publisher(&topic("pose"), Kept::Queue(1))?,
            status: node.publisher(&topic("status"), Kept::Queue(1))?,
            reception: node.publisher(&topic("reception"), Kept::Queue(100))?,
            order: node.subscriber(&topic("order"), 10)?,
            _node: node,
        })
    }
}

impl<H: RosHeader, N> DroneLink for DroneEnd<H, N> {
    fn send(&mut self, report: &Report) -> Result<(), LinkError> {
        match report {
            Report::Pose { at, pose } => self.pose.publish(convert::pose_message(*at, pose)?),
            Report::Status(status) => self.status.publish(convert::status_message(status)?),
            Report::Delivery(delivery) => {
                self.reception.publish(convert::reception_message(delivery)?)
            }
        }
    }

    fn receive(&mut self) -> Result<Option<link::Order>, LinkError> {
        Ok(self.order.take()?.map(|message| convert::order(&message)))
    }
}
