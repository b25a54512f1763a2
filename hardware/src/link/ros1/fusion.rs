use std::{
    collections::{BTreeMap, btree_map::Entry},
    fmt,
};

use super::{Announced, Header, Joined, Listener, Ros1Config, Speaker};
use crate::link::{FusionLink, LinkError, Order, Report, View, ros};

/// The fusing end of a link over ROS 1: the drones' topics the other way round, and for viewers each
/// drone's `goal` and `path`, `/foxhunt/beacon_<n>/estimate` and `/diagnostics`.
pub struct Ros1Fusion {
    drones: Vec<Drone>,
    estimates: BTreeMap<u16, Announced<ros::PoseWithCovarianceStamped<Header>>>,
    diagnostics: Speaker<ros::DiagnosticArray<Header>>,
    /// Who is asked first, so that none is heard more than others.
    turn: usize,
    node: Joined,
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

impl fmt::Debug for Ros1Fusion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Ros1Fusion").field("drones", &self.drones.len()).finish_non_exhaustive()
    }
}

impl Ros1Fusion {
    /// Joins the network as the one that fuses for so many drones; waits for the master's answers.
    /// Nothing waits later: a beacon's topic is shown on as soon as the master knows of it.
    ///
    /// # Errors
    ///
    /// [`LinkError::Open`] names what could not be set up.
    pub fn join(config: &Ros1Config, drones: usize) -> Result<Self, LinkError> {
        let node = Joined::join(config, "fusion")?;
        let of = |drone: usize| {
            let topic = |what| ros::drone_topic(drone, what);
            Ok(Drone {
                pose: node.listener(&topic("pose"))?,
                status: node.listener(&topic("status"))?,
                reception: node.listener(&topic("reception"))?,
                order: node.speaker(&topic("order"), false)?,
                goal: node.speaker(&topic("goal"), true)?,
                path: node.speaker(&topic("path"), true)?,
            })
        };
        let drones = (0..drones).map(of).collect::<Result<_, LinkError>>()?;
        let diagnostics = node.speaker(ros::DIAGNOSTICS, false)?;
        Ok(Self { drones, estimates: BTreeMap::new(), diagnostics, turn: 0, node })
    }
}

impl Drone {
    fn hear(&mut self) -> Result<Option<Report>, LinkError> {
        if let Some(message) = self.reception.hear()? {
            return Ok(Some(Report::Delivery(Box::new(ros::delivery(message)))));
        }
        if let Some(message) = self.status.hear()? {
            return Ok(Some(ros::report_of_status(message)));
        }
        Ok(self.pose.hear()?.map(|message| ros::report_of_pose(&message)))
    }
}

impl FusionLink for Ros1Fusion {
    fn send(&mut self, drone: usize, order: &Order) -> Result<(), LinkError> {
        let drones = self.drones.len();
        let to = self.drones.get(drone).ok_or(LinkError::Drone { drone, drones })?;
        to.order.say(&ros::order_message(order)?)
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
            let message = ros::estimate(at, &beacon.estimate)?;
            let said = match self.estimates.entry(beacon.number) {
                Entry::Occupied(known) => known.into_mut().say(&message),
                Entry::Vacant(new) => {
                    let topic = ros::beacon_topic(beacon.number, "estimate");
                    new.insert(self.node.announce(&topic)?).say(&message)
                }
            };
            if matches!(said, Err(LinkError::Open { .. })) {
                self.estimates.remove(&beacon.number);
            }
            said?;
        }
        for (drone, shown) in self.drones.iter().zip(&view.drones) {
            if let Some(goal) = &shown.goal {
                drone.goal.say(&ros::goal(at, goal)?)?;
            }
            drone.path.say(&ros::path(at, shown)?)?;
        }
        self.diagnostics.say(&ros::diagnostics(at, &view.health)?)
    }
}
