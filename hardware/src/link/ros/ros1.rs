//! The link over ROS 1: the reference system's middleware.

use std::{
    pin::pin,
    task::{Context, Poll, Waker},
    time::Duration,
};

use roslibrust::{
    MessageDescriptor, RosMessageType,
    ros1::{NodeError, NodeHandle},
};
use serde::{Deserialize, Serialize};
use tokio::{
    runtime::{Builder, Runtime},
    task::JoinHandle,
};

use super::ends::{DroneEnd, FusionEnd};
use crate::link::{
    DroneLink, FusionLink, LinkError, Order, Report, TeamKey, UnixTime, View,
    ros::{
        self, FRAME, Kept, Publish, Publisher, RosHeader, Subscribe, Subscriber, Topics,
        drone_name, seconds,
    },
};

/// Name of the link in errors.
const OVER: &str = "ROS 1";

/// Most messages that are kept for subscribers that are slow.
const QUEUE: usize = 100;

/// A drone's end of a link over ROS 1: `/foxhunt/drone_<n>/` with `pose`, `status` and `reception`
/// out, and `order` in. With the key of the team it sends `signed_report` and takes `signed_order`,
/// and `pose` is for viewers alone.
#[derive(Debug)]
pub struct Ros1Drone(DroneEnd<Header, Node>);

impl Ros1Drone {
    /// Joins the network as a drone, counted from 0; waits for the master's answers. Without a
    /// key nothing is signed, and the drone follows whoever sends.
    ///
    /// # Errors
    ///
    /// [`LinkError::Open`] names what could not be set up.
    pub fn join(
        config: &Ros1Config,
        drone: usize,
        key: Option<TeamKey>,
    ) -> Result<Self, LinkError> {
        let node = Node::join(config, &drone_name(drone))?;
        DroneEnd::new(node, drone, key).map(Self)
    }
}

impl DroneLink for Ros1Drone {
    fn send(&mut self, report: &Report) -> Result<(), LinkError> {
        self.0.send(report)
    }

    fn receive(&mut self) -> Result<Option<Order>, LinkError> {
        self.0.receive()
    }
}

/// The fusing end of a link over ROS 1: the drones' topics the other way round, and for viewers
/// each drone's `goal` and `path`, `/foxhunt/beacon_<n>/estimate` and `/diagnostics`.
/// With the key of the team it takes `signed_report` of each drone and sends `signed_order`.
#[derive(Debug)]
pub struct Ros1Fusion(FusionEnd<Header, Node>);

impl Ros1Fusion {
    /// Joins the network as the fusing node, for a number of drones; waits for the master's
    /// answers. Nothing waits later: a beacon's topic is published on as soon as the master knows
    /// of it. Without a key nothing is signed, and every sender is believed.
    ///
    /// # Errors
    ///
    /// [`LinkError::Open`] names what could not be set up.
    pub fn join(
        config: &Ros1Config,
        drones: usize,
        key: Option<TeamKey>,
    ) -> Result<Self, LinkError> {
        FusionEnd::new(Node::join(config, "fusion")?, drones, key).map(Self)
    }
}

impl FusionLink for Ros1Fusion {
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

/// `std_msgs/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Header {
    /// Stays 0.
    seq: u32,
    sec: u32,
    nanosec: u32,
    frame_id: String,
}

impl RosHeader for Header {
    fn at(moment: UnixTime) -> Result<Self, LinkError> {
        let sec = seconds("stamp.secs", moment)?;
        Ok(Self { seq: 0, sec, nanosec: moment.nanosec, frame_id: FRAME.to_owned() })
    }

    fn moment(&self) -> UnixTime {
        UnixTime { sec: i64::from(self.sec), nanosec: self.nanosec }
    }
}

/// Settings of a node in the network. Its own name in it comes from `ROS_HOSTNAME` or `ROS_IP`, as
/// for every node of ROS 1.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Ros1Config {
    /// Address of the master, as in `ROS_MASTER_URI`.
    pub master_uri: String,
}

impl Default for Ros1Config {
    /// A master on this machine.
    fn default() -> Self {
        Self { master_uri: "http://localhost:11311".to_owned() }
    }
}

/// A node that has joined. What serves it runs on a thread of its own, which ends with it.
struct Node {
    // Before the runtime that it needs for its farewell to the master.
    node: Option<NodeHandle>,
    runtime: Option<Runtime>,
}

/// A topic that the master knows of, with its name for errors.
struct Advertised<M>(roslibrust::ros1::Publisher<M>, String);

/// A topic that is published on as soon as the master has answered, with its name for errors.
enum Pending<M> {
    Requested(JoinHandle<Result<roslibrust::ros1::Publisher<M>, NodeError>>, String),
    Open(Advertised<M>),
}

/// A topic that is subscribed to, with its name for errors.
struct Subscribed<M>(roslibrust::ros1::Subscriber<M>, String);

impl Node {
    /// Joins as a node of this name; waits for the master's answer.
    fn join(config: &Ros1Config, name: &str) -> Result<Self, LinkError> {
        let mut building = Builder::new_multi_thread();
        let runtime = building.worker_threads(1).enable_all().build();
        let runtime = runtime.map_err(|error| open("its thread", error))?;
        let node = runtime
            .block_on(NodeHandle::new(&config.master_uri, &format!("/foxhunt/{name}")))
            .map_err(|error| {
                open(&format!("the node {name} at the master {}", config.master_uri), error)
            })?;
        Ok(Self { node: Some(node), runtime: Some(runtime) })
    }

    fn parts(&self) -> Result<(&NodeHandle, &Runtime), LinkError> {
        self.node.as_ref().zip(self.runtime.as_ref()).ok_or_else(|| open("a topic", "it has left"))
    }
}

impl<M: RosMessageType> Topics<M> for Node {
    fn publisher(&mut self, topic: &str, kept: Kept) -> Result<Publisher<M>, LinkError> {
        let (node, runtime) = self.parts()?;
        let made = runtime.block_on(node.advertise::<M>(topic, QUEUE, kept == Kept::Last));
        Ok(Box::new(Advertised(made.map_err(|error| open(topic, error))?, topic.to_owned())))
    }

    fn late_publisher(&mut self, topic: &str) -> Result<Publisher<M>, LinkError> {
        let (node, runtime) = self.parts()?;
        let node = node.clone();
        let name = topic.to_owned();
        let requested = runtime.spawn(async move { node.advertise::<M>(&name, QUEUE, true).await });
        Ok(Box::new(Pending::Requested(requested, topic.to_owned())))
    }

    fn subscriber(&mut self, topic: &str, _: usize) -> Result<Subscriber<M>, LinkError> {
        let (node, runtime) = self.parts()?;
        let made = runtime.block_on(node.subscribe::<M>(topic, QUEUE));
        Ok(Box::new(Subscribed(made.map_err(|error| open(topic, error))?, topic.to_owned())))
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        self.node = None;
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_timeout(Duration::from_millis(500));
        }
    }
}

impl<M: RosMessageType> Publish<M> for Pending<M> {
    fn publish(&mut self, message: M) -> Result<(), LinkError> {
        if let Self::Requested(requested, topic) = self
            && let Some(answer) = now(requested)
        {
            let made = answer.map_err(|error| open(topic, error))?;
            let made = made.map_err(|error| open(topic, error))?;
            *self = Self::Open(Advertised(made, std::mem::take(topic)));
        }
        match self {
            Self::Requested(..) => Ok(()),
            Self::Open(advertised) => advertised.publish(message),
        }
    }
}

impl<M: RosMessageType> Publish<M> for Advertised<M> {
    fn publish(&mut self, message: M) -> Result<(), LinkError> {
        // It is put into a queue, or nobody has subscribed.
        let published = now(self.0.publish(&message));
        published.map_or(Ok(()), |done| done.map_err(|error| failed(&self.1, error)))
    }
}

impl<M: RosMessageType> Subscribe<M> for Subscribed<M> {
    fn take(&mut self) -> Result<Option<M>, LinkError> {
        match now(self.0.next()) {
            None => Ok(None),
            Some(Some(Ok(message))) => Ok(Some(message)),
            // Among them: some were lost because they were not taken in time, and will be repeated.
            Some(Some(Err(error))) => Err(failed(&self.1, error)),
            Some(None) => Err(failed(&self.1, "the node has left")),
        }
    }
}

// Names, definitions and MD5 sums of messages, by which nodes make sure that they mean the same.

/// Begins the definition of a message within another.
macro_rules! nested {
    ($name:literal, $fields:expr) => {
        concat!(
            "================================================================================\n",
            "MSG: ",
            $name,
            "\n",
            $fields
        )
    };
}

macro_rules! header {
    () => {
        nested!("std_msgs/Header", "uint32 seq\ntime stamp\nstring frame_id\n")
    };
}

macro_rules! point {
    () => {
        nested!("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n")
    };
}

macro_rules! pose {
    () => {
        concat!(
            nested!(
                "geometry_msgs/Pose",
                "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
            ),
            point!(),
            nested!("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n")
        )
    };
}

macro_rules! described {
    ($message:ident, $($rest:tt)+) => {
        described!(@ ros::$message<Header>, $($rest)+);
    };
    (@ $message:ty, $name:literal, $md5:literal, $definition:expr) => {
        impl RosMessageType for $message {
            const DESCRIPTION: MessageDescriptor =
                MessageDescriptor::new::<Self>($name, $md5, $definition, "", &[0; 32]);
        }
    };
}

described!(
    PoseStamped,
    "geometry_msgs/PoseStamped",
    "d3812c3cbc69362b77dc0b19b345f8f5",
    concat!("std_msgs/Header header\ngeometry_msgs/Pose pose\n", header!(), pose!())
);

described!(
    PoseWithCovarianceStamped,
    "geometry_msgs/PoseWithCovarianceStamped",
    "953b798c0f514ff060a53a3498ce6246",
    concat!(
        "std_msgs/Header header\ngeometry_msgs/PoseWithCovariance pose\n",
        header!(),
        nested!(
            "geometry_msgs/PoseWithCovariance",
            "geometry_msgs/Pose pose\nfloat64[36] covariance\n"
        ),
        pose!()
    )
);

described!(
    Path,
    "nav_msgs/Path",
    "6227e2b7e9cce15051f669a5e197bbf7",
    concat!(
        "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n",
        header!(),
        nested!("geometry_msgs/PoseStamped", "std_msgs/Header header\ngeometry_msgs/Pose pose\n"),
        pose!()
    )
);

described!(
    DiagnosticArray,
    "diagnostic_msgs/DiagnosticArray",
    "60810da900de1dd6ddd437c3503511da",
    concat!(
        "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n",
        header!(),
        nested!(
            "diagnostic_msgs/DiagnosticStatus",
            "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\n\
             string message\nstring hardware_id\ndiagnostic_msgs/KeyValue[] values\n"
        ),
        nested!("diagnostic_msgs/KeyValue", "string key\nstring value\n")
    )
);

described!(
    Reception,
    "foxhunt_msgs/Reception",
    "07c7ec36ffa9e010c4013b2ba67a5817",
    concat!(include_str!("../../../ros/foxhunt_msgs/msg/Reception.msg"), header!(), point!())
);

described!(
    Order,
    "foxhunt_msgs/Order",
    "a0842a274dbd6a8543679569d3f83e66",
    concat!(include_str!("../../../ros/foxhunt_msgs/msg/Order.msg"), header!(), point!())
);

described!(
    Status,
    "foxhunt_msgs/Status",
    "b6caffdaadc2e3e499c2c706c2485423",
    concat!(include_str!("../../../ros/foxhunt_msgs/msg/Status.msg"), header!())
);

described!(@ ros::Text, "std_msgs/String", "992ce8a1687cec8c8bd883ec73ca41d1", "string data\n");

fn open(what: &str, reason: impl std::fmt::Display) -> LinkError {
    LinkError::Open { over: OVER, what: what.to_owned(), reason: reason.to_string() }
}

/// Returns a future's output if it is there by now; nothing is waited for.
fn now<F: Future>(future: F) -> Option<F::Output> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(output) => Some(output),
        Poll::Pending => None,
    }
}

fn failed(topic: &str, reason: impl std::fmt::Display) -> LinkError {
    LinkError::Message { over: OVER, what: topic.to_owned(), reason: reason.to_string() }
}

#[cfg(test)]
mod tests {
    use roslibrust::md5sum::from_message_definition;

    use super::*;

    fn check<M: RosMessageType>() {
        let MessageDescriptor { ros_type_name, definition, md5sum, .. } = M::DESCRIPTION;
        let reckoned = from_message_definition(ros_type_name, definition);
        assert_eq!(reckoned.expect("a definition"), md5sum, "{ros_type_name}");
    }

    #[test]
    fn sums_are_those_of_the_definitions() {
        check::<ros::PoseStamped<Header>>();
        check::<ros::PoseWithCovarianceStamped<Header>>();
        check::<ros::Path<Header>>();
        check::<ros::DiagnosticArray<Header>>();
        check::<ros::Reception<Header>>();
        check::<ros::Order<Header>>();
        check::<ros::Status<Header>>();
        check::<ros::Text>();
    }
}
