use std::fmt;

use super::{
    Kept, Order, PoseStamped, Publisher, Reception, RosHeader, Status, Subscriber, Text, Topics,
    carrier::RosCarrier, convert, drone_topic,
};
use crate::link::{self, CarriedDrone, DroneLink, LinkError, Report, TeamKey};

/// A drone's end of a link over ROS: `/foxhunt/drone_<n>/` with `pose`, `status` and `reception`
/// out, and `order` in; with a key `pose` for viewers, `signed_report` out and `signed_order` in.
pub(in crate::link) struct DroneEnd<H, N> {
    drone: usize,
    pose: Publisher<PoseStamped<H>>,
    channel: Channel<H>,
    /// The topics live no longer than their node.
    _node: N,
}

/// Topics of orders and of all reports but the pose, signed or not.
enum Channel<H> {
    Open {
        status: Publisher<Status<H>>,
        reception: Publisher<Reception<H>>,
        order: Subscriber<Order<H>>,
    },
    /// The pose goes by it too.
    Signed(Box<CarriedDrone<RosCarrier>>),
}

impl<H, N> fmt::Debug for DroneEnd<H, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DroneEnd").field("drone", &self.drone).finish_non_exhaustive()
    }
}

impl<H, N> DroneEnd<H, N>
where
    N: Topics<PoseStamped<H>>
        + Topics<Status<H>>
        + Topics<Reception<H>>
        + Topics<Order<H>>
        + Topics<Text>,
{
    /// The topics of a drone, counted from 0. With a key everything is signed.
    pub(in crate::link) fn new(
        mut node: N,
        drone: usize,
        key: Option<TeamKey>,
    ) -> Result<Self, LinkError> {
        let topic = |what| drone_topic(drone, what);
        let pose = node.publisher(&topic("pose"), Kept::Queue(1))?;
        let channel = match key {
            Some(key) => {
                let carrier = RosCarrier::drone(&mut node, drone)?;
                Channel::Signed(Box::new(CarriedDrone::new(carrier, drone, Some(key))?))
            }
            None => Channel::Open {
                status: node.publisher(&topic("status"), Kept::Queue(1))?,
                reception: node.publisher(&topic("reception"), Kept::Queue(100))?,
                order: node.subscriber(&topic("order"), 10)?,
            },
        };
        Ok(Self { drone, pose, channel, _node: node })
    }
}

impl<H: RosHeader, N> DroneLink for DroneEnd<H, N> {
    fn send(&mut self, report: &Report) -> Result<(), LinkError> {
        if let Report::Pose { at, pose } = report {
            self.pose.publish(convert::pose_message(*at, pose)?)?;
        }
        match (&mut self.channel, report) {
            (Channel::Signed(link), _) => link.send(report),
            (Channel::Open { .. }, Report::Pose { .. }) => Ok(()),
            (Channel::Open { status, .. }, Report::Status(sent)) => {
                status.publish(convert::status_message(sent)?)
            }
            (Channel::Open { reception, .. }, Report::Delivery(delivery)) => {
                reception.publish(convert::reception_message(delivery)?)
            }
        }
    }

    fn receive(&mut self) -> Result<Option<link::Order>, LinkError> {
        match &mut self.channel {
            Channel::Signed(link) => link.receive(),
            Channel::Open { order, .. } => {
                Ok(order.take()?.map(|message| convert::order(&message)))
            }
        }
    }
}
