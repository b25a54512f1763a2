//! The two ends of a link over topics of either version of ROS.

use std::{
    collections::{BTreeMap, btree_map::Entry},
    fmt,
};

use super::{
    DIAGNOSTICS, DiagnosticArray, Kept, Order, Path, PoseStamped, PoseWithCovarianceStamped,
    Publisher, Reception, RosHeader, Status, Subscriber, Text, Topics, beacon_topic, convert,
    drone_topic,
};
use crate::link::{
    self, CarriedDrone, CarriedFusion, Carrier, DroneLink, FusionLink, LinkError, Report, TeamKey,
    View,
};

/// Number of messages that wait for a slow end.
const DEPTH: usize = 100;

/// A drone's end of a link over ROS: `/foxhunt/drone_<n>/` with `pose`, `status` and `reception`
/// out, and `order` in; with a key `pose` for viewers, `signed_report` out and `signed_order` in.
pub(super) struct DroneEnd<H, N> {
    drone: usize,
    pose: Publisher<PoseStamped<H>>,
    channel: DroneChannel<H>,
    /// The topics live no longer than their node.
    _node: N,
}

/// Topics of orders and of all reports but the pose, signed or not.
enum DroneChannel<H> {
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
    pub(super) fn new(mut node: N, drone: usize, key: Option<TeamKey>) -> Result<Self, LinkError> {
        let topic = |what| drone_topic(drone, what);
        let pose = node.publisher(&topic("pose"), Kept::Queue(1))?;
        let channel = match key {
            Some(key) => {
                let carrier = RosCarrier::drone(&mut node, drone)?;
                DroneChannel::Signed(Box::new(CarriedDrone::new(carrier, drone, Some(key))?))
            }
            None => DroneChannel::Open {
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
            (DroneChannel::Signed(link), _) => link.send(report),
            (DroneChannel::Open { .. }, Report::Pose { .. }) => Ok(()),
            (DroneChannel::Open { status, .. }, Report::Status(sent)) => {
                status.publish(convert::status_message(sent)?)
            }
            (DroneChannel::Open { reception, .. }, Report::Delivery(delivery)) => {
                reception.publish(convert::reception_message(delivery)?)
            }
        }
    }

    fn receive(&mut self) -> Result<Option<link::Order>, LinkError> {
        match &mut self.channel {
            DroneChannel::Signed(link) => link.receive(),
            DroneChannel::Open { order, .. } => {
                Ok(order.take()?.map(|message| convert::order(&message)))
            }
        }
    }
}

/// The fusing end of a link over ROS: the drones' topics the other way round, and for viewers each
/// drone's `goal` and `path`, `/foxhunt/beacon_<n>/estimate` and `/diagnostics`.
pub(super) struct FusionEnd<H, N> {
    channel: FusionChannel<H>,
    shown: Vec<Shown<H>>,
    estimates: BTreeMap<u16, Publisher<PoseWithCovarianceStamped<H>>>,
    diagnostics: Publisher<DiagnosticArray<H>>,
    /// The topics live no longer than their node.
    node: N,
}

/// Topics of orders and reports, signed or not.
enum FusionChannel<H> {
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
    pub(super) fn new(mut node: N, drones: usize, key: Option<TeamKey>) -> Result<Self, LinkError> {
        let channel = match key {
            Some(key) => {
                let carrier = RosCarrier::fusion(&mut node, drones)?;
                FusionChannel::Signed(CarriedFusion::new(carrier, drones, Some(key))?)
            }
            None => FusionChannel::Open(Drones::new(&mut node, drones)?),
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
            FusionChannel::Open(drones) => drones.send(drone, order),
            FusionChannel::Signed(link) => link.send(drone, order),
        }
    }

    fn receive(&mut self) -> Result<Option<(usize, Report)>, LinkError> {
        match &mut self.channel {
            FusionChannel::Open(drones) => drones.take(),
            FusionChannel::Signed(link) => link.receive(),
        }
    }

    fn show(&mut self, view: &View) -> Result<(), LinkError> {
        let at = view.at;
        for beacon in &view.beacons {
            let message = convert::estimate_message(at, &beacon.estimate)?;
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
                topics.goal.publish(convert::goal_message(at, goal)?)?;
            }
            topics.path.publish(convert::path_message(at, drone)?)?;
        }
        self.diagnostics.publish(convert::diagnostics_message(at, &view.health)?)
    }
}

/// Signed messages as text, on two topics of each drone: `signed_report` and `signed_order`.
struct RosCarrier {
    channels: Vec<Channel>,
    /// Index of the channel whose turn was last.
    turn: usize,
}

/// The two topics of a drone, counted from 0.
struct Channel {
    drone: usize,
    out: Publisher<Text>,
    into: Subscriber<Text>,
}

impl RosCarrier {
    /// The end of a drone.
    fn drone(node: &mut impl Topics<Text>, drone: usize) -> Result<Self, LinkError> {
        Self::new(node, std::iter::once(drone), "signed_report", "signed_order")
    }

    /// Returns the fusing end, for a number of drones.
    fn fusion(node: &mut impl Topics<Text>, drones: usize) -> Result<Self, LinkError> {
        Self::new(node, 0..drones, "signed_order", "signed_report")
    }

    fn new(
        node: &mut impl Topics<Text>,
        drones: impl Iterator<Item = usize>,
        out: &str,
        into: &str,
    ) -> Result<Self, LinkError> {
        let channel = |drone| {
            let out = node.publisher(&drone_topic(drone, out), Kept::Queue(DEPTH))?;
            let into = node.subscriber(&drone_topic(drone, into), DEPTH)?;
            Ok(Channel { drone, out, into })
        };
        Ok(Self { channels: drones.map(channel).collect::<Result<_, LinkError>>()?, turn: 0 })
    }
}

impl Carrier for RosCarrier {
    fn send(&mut self, drone: usize, payload: Vec<u8>) -> Result<(), LinkError> {
        let drones = self.channels.len();
        let to = self.channels.iter_mut().find(|channel| channel.drone == drone);
        let to = to.ok_or(LinkError::Drone { drone, drones })?;
        let data = String::from_utf8(payload)
            .map_err(|error| LinkError::Value { field: "a message", value: error.to_string() })?;
        to.out.publish(Text { data })
    }

    fn receive(&mut self) -> Result<Option<(usize, Vec<u8>)>, LinkError> {
        let count = self.channels.len();
        for _ in 0..count {
            // Each has its turn, so that a flood on one channel holds up no other.
            self.turn = (self.turn + 1) % count;
            let channel = &mut self.channels[self.turn];
            if let Some(Text { data }) = channel.into.take()? {
                return Ok(Some((channel.drone, data.into_bytes())));
            }
        }
        Ok(None)
    }
}
