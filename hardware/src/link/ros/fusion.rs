use std::{
    collections::{BTreeMap, btree_map::Entry},
    fmt,
};

use super::{
    DIAGNOSTICS, DiagnosticArray, Kept, Order, Path, PoseStamped, PoseWithCovarianceStamped,
    Publisher, Reception, RosHeader, Status, Subscriber, Topics, beacon_topic, convert,
    drone_topic, show,
};
use crate::link::{self, FusionLink, LinkError, Report, View};

/// The fusing end of a link over ROS: the drones' topics the other way round, and for viewers each
/// drone's `goal` and `path`, `/foxhunt/beacon_<n>/estimate` and `/diagnostics`.
pub(in crate::link) struct FusionEnd<H, N> {
    drones: Vec<Drone<H>>,
    estimates: BTreeMap<u16, Publisher<PoseWithCovarianceStamped<H>>>,
    diagnostics: Publisher<DiagnosticArray<H>>,
    /// Which drone's topics were read last, so that each has its turn.
    turn: usize,
    /// The topics live no longer than their node.
    node: N,
}

/// The topics of one drone.
struct Drone<H> {
    pose: Subscriber<PoseStamped<H>>,
    status: Subscriber<Status<H>>,
    reception: Subscriber<Reception<H>>,
    order: Publisher<Order<H>>,
    goal: Publisher<PoseStamped<H>>,
    path: Publisher<Path<H>>,
}

impl<H, N> fmt::Debug for FusionEnd<H, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FusionEnd").field("drones", &self.drones.len()).finish_non_exhaustive()
    }
}

impl<H, N> FusionEnd<H, N>
where
    N: Topics<PoseStamped<H>>
        + Topics<Status<H>>
        + Topics<Reception<H>>
        + Topics<Order<H>>
        + Topics<Path<H>>
        + Topics<DiagnosticArray<H>>,
{
    /// The topics of so many drones.
    pub(in crate::link) fn new(mut node: N, drones: usize) -> Result<Self, LinkError> {
        let mut of = |drone: usize| {
            let topic = |what| drone_topic(drone, what);
            Ok(Drone {
                pose: node.subscriber(&topic("pose"), 10)?,
                status: node.subscriber(&topic("status"), 10)?,
                reception: node.subscriber(&topic("reception"), 100)?,
                order: node.publisher(&topic("order"), Kept::Queue(1))?,
                goal: node.publisher(&topic("goal"), Kept::Last)?,
                path: node.publisher(&topic("path"), Kept::Last)?,
            })
        };
        let drones = (0..drones).map(&mut of).collect::<Result<_, LinkError>>()?;
        let diagnostics = node.publisher(DIAGNOSTICS, Kept::Queue(1))?;
        Ok(Self { drones, estimates: BTreeMap::new(), diagnostics, turn: 0, node })
    }
}

impl<H: RosHeader> Drone<H> {
    fn take(&mut self) -> Result<Option<Report>, LinkError> {
        if let Some(message) = self.reception.take()? {
            return Ok(Some(Report::Delivery(Box::new(convert::delivery(message)))));
        }
        if let Some(message) = self.status.take()? {
            return Ok(Some(convert::report_of_status(message)));
        }
        Ok(self.pose.take()?.map(|message| convert::report_of_pose(&message)))
    }
}

impl<H: RosHeader, N: Topics<PoseWithCovarianceStamped<H>>> FusionLink for FusionEnd<H, N> {
    fn send(&mut self, drone: usize, order: &link::Order) -> Result<(), LinkError> {
        let drones = self.drones.len();
        let to = self.drones.get_mut(drone).ok_or(LinkError::Drone { drone, drones })?;
        to.order.publish(convert::order_message(order)?)
    }

    fn receive(&mut self) -> Result<Option<(usize, Report)>, LinkError> {
        for _ in 0..self.drones.len() {
            self.turn = (self.turn + 1) % self.drones.len();
            if let Some(report) = self.drones[self.turn].take()? {
                return Ok(Some((self.turn, report)));
            }
        }
        Ok(None)
    }

    fn show(&mut self, view: &View) -> Result<(), LinkError> {
        let at = view.at;
        for beacon in &view.beacons {
            let message = show::estimate(at, &beacon.estimate)?;
            let publisher = match self.estimates.entry(beacon.number) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(new) => {
                    let topic = beacon_topic(beacon.number, "estimate");
                    new.insert(self.node.late_publisher(&topic)?)
                }
            };
            let published = publisher.publish(message);
            if matches!(published, Err(LinkError::Open { .. })) {
                self.estimates.remove(&beacon.number);
            }
            published?;
        }
        for (drone, shown) in self.drones.iter_mut().zip(&view.drones) {
            if let Some(goal) = &shown.goal {
                drone.goal.publish(show::goal(at, goal)?)?;
            }
            drone.path.publish(show::path(at, shown)?)?;
        }
        self.diagnostics.publish(show::diagnostics(at, &view.health)?)
    }
}
