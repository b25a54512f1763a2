use super::{Header, Node, Ros2Config};
use crate::link::{FusionLink, LinkError, Order, Report, TeamKey, View, ros::FusionEnd};

/// The fusing end of a link over ROS 2: the drones' topics the other way round, and for viewers
/// each drone's `goal` and `path`, `/foxhunt/beacon_<n>/estimate` and `/diagnostics`.
/// With the key of the team it takes `signed_report` of each drone and sends `signed_order`.
#[derive(Debug)]
pub struct Ros2Fusion(FusionEnd<Header, Node>);

impl Ros2Fusion {
    /// Joins the network as the one that fuses, for a number of drones. Without a key nothing is
    /// signed, and whoever sends is believed.
    ///
    /// # Errors
    ///
    /// [`LinkError::Open`] names what could not be set up.
    pub fn join(
        config: Ros2Config,
        drones: usize,
        key: Option<TeamKey>,
    ) -> Result<Self, LinkError> {
        FusionEnd::new(Node::join(config, "fusion")?, drones, key).map(Self)
    }
}

impl FusionLink for Ros2Fusion {
    fn send(&mut self, drone: usize, order: &Order) -> Result<(), LinkError> {
        self.0.send(drone, order)
    }

    fn receive(&mut self) -> Result<Option<(usize, Report)>, LinkError> {
        self.0.receive()
    }

    fn show(&mut self, view: &View) -> Result<(), LinkError> {
        self.0.show(view)
    }
}
