use std::{
    collections::{BTreeMap, btree_map::Entry},
    fmt,
};

use super::{
    DIAGNOSTICS, DiagnosticArray, Kept, Order, Path, PoseStamped, PoseWithCovarianceStamped,
    Publisher, Reception, RosHeader, Status, Subscriber, Text, Topics, beacon_topic,
    carrier::RosCarrier, convert, drone_topic, show,
};
use crate::link::{self, CarriedFusion, FusionLink, LinkError, Report, TeamKey, View};

/// The fusing end of a link over ROS: the drones' topics the other way round, and for viewers each
/// drone's `goal` and `path`, `/foxhunt/beacon_<n>/estimate` and `/diagnostics`.
pub(in crate::link) struct FusionEnd<H, N> {
    channel: Channel<H>,
    shown: Vec<Shown<H>>,
    estimates: BTreeMap<u16, Publisher<PoseWithCovarianceStamped<H>>>,
    diagnostics: Publisher<DiagnosticArray<H>>,
    /// The topics live no longer than their node.
    node: N,
}

/// Topics of orders and reports, signed or not.
enum Channel<H> {
    Open(Drones<H>),
    Signed(CarriedFusion<RosCarrier>),
}

/// The topics of all drones.
struct Drones<H> {
    drones: Vec<Drone<H>>,
    /// Index of the drone whose topics were read last, so that each has its turn.
    turn: usize,
}

/// The topics of one drone.
struct Drone<H> {
    pose: Subscriber<PoseStamped<H>>,
    status: Subscriber<Status<H>>,
    reception: Subscriber<Reception<H>>,
    order: Publisher<Order<H>>,
}

/// Topics of one drone for viewers.
struct Shown<H> {
    goal: Publisher<PoseStamped<H>>,
    path: Publisher<Path<H>>,
}

impl<H, N> fmt::Debug for FusionEnd<H, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FusionEnd").field("drones", &self.shown.len()).finish_non_exhaustive()
    }
}

impl<H, N> FusionEnd<H, N>
where
    N: Topics<PoseStamped<H>>
        + Topics<Status<H>>
        + Topics<Reception<H>>
        + Topics<Order<H>>
        + Topics<Path<H>>
        + Topics<DiagnosticArray<H>>
        + Topics<Text>,
{
    /// The topics of a number of drones. With a key no report counts that is not signed with it.
    pub(in crate::link) fn new(
        mut node: N,
        drones: usize,
        key: Option<TeamKey>,
    ) -> Result<Self, LinkError> {
        let channel = match key {
            Some(key) => {
                let carrier = RosCarrier::fusion(&mut node, drones)?;
                Channel::Signed(CarriedFusion::new(carrier, drones, Some(key))?)
            }
            None => Channel::Open(Drones::new(&mut node, drones)?),
        };
        let mut shown = |drone| {
            Ok(Shown {
                goal: node.publisher(&drone_topic(drone, "goal"), Kept::Last)?,
                path: node.publisher(&drone_topic(drone, "path"), Kept::Last)?,
            })
        };
        let shown = (0..drones).map(&mut shown).collect::<Result<_, LinkError>>()?;
        let diagnostics = node.publisher(DIAGNOSTICS, Kept::Queue(1))?;
        Ok(Self { channel, shown, estimates: BTreeMap::new(), diagnostics, node })
    }
}

impl<H> Drones<H> {
    fn new<N>(node: &mut N, drones: usize) -> Result<Self, LinkError>
    where
        N: Topics<PoseStamped<H>> + Topics<Status<H>> + Topics<Reception<H>> + Topics<Order<H>>,
    {
        let of = |drone| {
            let topic = |what| drone_topic(drone, what);
            Ok(Drone {
                pose: node.subscriber(&topic("pose"), 10)?,
                status: node.subscriber(&topic("status"), 10)?,
                reception: node.subscriber(&topic("reception"), 100)?,
                order: node.publisher(&topic("order"), Kept::Queue(1))?,
            })
        };
        Ok(Self { drones: (0..drones).map(of).collect::<Result<_, LinkError>>()?, turn: 0 })
    }
}

impl<H: RosHeader> Drones<H> {
    fn send(&mut self, drone: usize, order: &link::Order) -> Result<(), LinkError> {
        let drones = self.drones.len();
        let to = self.drones.get_mut(drone).ok_or(LinkError::Drone { drone, drones })?;
        to.order.publish(convert::order_message(order)?)
    }

    fn take(&mut self) -> Result<Option<(usize, Report)>, LinkError> {
        for _ in 0..self.drones.len() {
            self.turn = (self.turn + 1) % self.drones.len();
            if let Some(report) = self.drones[self.turn].take()? {
                return Ok(Some((self.turn, report)));
            }
        }
        Ok(None)
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
        match &mut self.channel {
            Channel::Open(drones) => drones.send(drone, order),
            Channel::Signed(link) => link.send(drone, order),
        }
    }

    fn receive(&mut self) -> Result<Option<(usize, Report)>, LinkError> {
        match &mut self.channel {
            Channel::Open(drones) => drones.take(),
            Channel::Signed(link) => link.receive(),
        }
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
        for (topics, drone) in self.shown.iter_mut().zip(&view.drones) {
            if let Some(goal) = &drone.goal {
                topics.goal.publish(show::goal(at, goal)?)?;
            }
            topics.path.publish(show::path(at, drone)?)?;
        }
        self.diagnostics.publish(show::diagnostics(at, &view.health)?)
    }
}
