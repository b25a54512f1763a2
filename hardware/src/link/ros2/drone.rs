use super::{Header, Node, Ros2Config};
use crate::link::{
    DroneLink, LinkError, Order, Report, TeamKey,
    ros::{DroneEnd, drone_name},
};

/// A drone's end of a link over ROS 2: `/foxhunt/drone_<n>/` with `pose`, `status` and `reception`
/// out, and `order` in. With the key of the team it sends `signed_report` and takes `signed_order`,
/// and `pose` is for viewers alone.
#[derive(Debug)]
pub struct Ros2Drone(DroneEnd<Header, Node>);

impl Ros2Drone {
    /// Joins the network as a drone, counted from 0. Without a key nothing is
    /// signed, and the drone follows whoever sends.
    ///
    /// # Errors
    ///
    /// [`LinkError::Open`] names what could not be set up.
    pub fn join(config: Ros2Config, drone: usize, key: Option<TeamKey>) -> Result<Self, LinkError> {
        let node = Node::join(config, &drone_name(drone))?;
        DroneEnd::new(node, drone, key).map(Self)
    }
}

impl DroneLink for Ros2Drone {
    fn send(&mut self, report: &Report) -> Result<(), LinkError> {
        self.0.send(report)
    }

    fn receive(&mut self) -> Result<Option<Order>, LinkError> {
        self.0.receive()
    }
}
