use std::{collections::BTreeMap, fmt};

use super::{
    Header, Kept, Opened, Ros2Config,
    node::{Listener, Speaker},
};
use crate::link::{FusionLink, LinkError, Order, Report, View, ros};

/// The fusing end of a link over ROS 2: the drones' topics the other way round, and for viewers each
/// drone's `goal` and `path`, `/foxhunt/beacon_<n>/estimate` and `/diagnostics`.
pub struct Ros2Fusion {
    drones: Vec<Drone>,
    estimates: BTreeMap<u16, Speaker<ros::PoseWithCovarianceStamped<Header>>>,
    diagnostics: Speaker<ros::DiagnosticArray<Header>>,
    /// Who is asked first, so that none is heard more than others.
    turn: usize,
    node: Opened,
}

/// The topics of one drone.
struct Drone {
    pose: Listener<ros::PoseStamped<Header>>,
    status: Listener<ros::Status<Header>>,
    reception: Listener<ros::Reception<Header>>,
    order: Speaker<ros::Order<Header>>,
    goal: Speaker<ros::PoseStamped<Header>>,
    path: Speaker<ros::Path<Header>>,
}

impl fmt::Debug for Ros2Fusion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Ros2Fusion").field("drones", &self.drones.len()).finish_non_exhaustive()
    }
}

impl Ros2Fusion {
    /// Joins the network as the one that fuses for so many drones.
    ///
    /// # Errors
    ///
    /// [`LinkError::Open`] names what could not be set up.
    pub fn join(config: Ros2Config, drones: usize) -> Result<Self, LinkError> {
        let mut node = Opened::join(config, "fusion")?;
        let mut of = |drone: usize| {
            let topic = |what| ros::drone_topic(drone, what);
            let (stamped, shown) = (("geometry_msgs", "PoseStamped"), Kept::Last);
            Ok(Drone {
                pose: node.listener(&topic("pose"), stamped, 10)?,
                status: node.listener(&topic("status"), ("foxhunt_msgs", "Status"), 10)?,
                reception: node.listener(
                    &topic("reception"),
                    ("foxhunt_msgs", "Reception"),
                    100,
                )?,
                order: node.speaker(
                    &topic("order"),
                    ("foxhunt_msgs", "Order"),
                    Kept::Nothing(1),
                )?,
                goal: node.speaker(&topic("goal"), stamped, shown)?,
                path: node.speaker(&topic("path"), ("nav_msgs", "Path"), shown)?,
            })
        };
        let drones = (0..drones).map(&mut of).collect::<Result<_, LinkError>>()?;
        let diagnostics = node.speaker(
            ros::DIAGNOSTICS,
            ("diagnostic_msgs", "DiagnosticArray"),
            Kept::Nothing(1),
        )?;
        Ok(Self { drones, estimates: BTreeMap::new(), diagnostics, turn: 0, node })
    }
}

impl Drone {
    fn hear(&self) -> Result<Option<Report>, LinkError> {
        if let Some(message) = self.reception.hear()? {
            return Ok(Some(Report::Delivery(Box::new(ros::delivery(message)))));
        }
        if let Some(message) = self.status.hear()? {
            return Ok(Some(ros::report_of_status(message)));
        }
        Ok(self.pose.hear()?.map(|message| ros::report_of_pose(&message)))
    }
}

impl FusionLink for Ros2Fusion {
    fn send(&mut self, drone: usize, order: &Order) -> Result<(), LinkError> {
        let drones = self.drones.len();
        let to = self.drones.get(drone).ok_or(LinkError::Drone { drone, drones })?;
        to.order.say(ros::order_message(order)?)
    }

    fn receive(&mut self) -> Result<Option<(usize, Report)>, LinkError> {
        for _ in 0..self.drones.len() {
            self.turn = (self.turn + 1) % self.drones.len();
            if let Some(report) = self.drones[self.turn].hear()? {
                return Ok(Some((self.turn, report)));
            }
        }
        Ok(None)
    }

    fn show(&mut self, view: &View) -> Result<(), LinkError> {
        let at = view.at;
        for beacon in &view.beacons {
            if !self.estimates.contains_key(&beacon.number) {
                let topic = ros::beacon_topic(beacon.number, "estimate");
                let kind = ("geometry_msgs", "PoseWithCovarianceStamped");
                let speaker = self.node.speaker(&topic, kind, Kept::Last)?;
                self.estimates.insert(beacon.number, speaker);
            }
            if let Some(speaker) = self.estimates.get(&beacon.number) {
                speaker.say(ros::estimate(at, &beacon.estimate)?)?;
            }
        }
        for (drone, shown) in self.drones.iter().zip(&view.drones) {
            if let Some(goal) = &shown.goal {
                drone.goal.say(ros::goal(at, goal)?)?;
            }
            drone.path.say(ros::path(at, shown)?)?;
        }
        self.diagnostics.say(ros::diagnostics(at, &view.health)?)
    }
}
