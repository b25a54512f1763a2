//! The link over ROS 2, by DDS.

use ros2_client::{
    Context, ContextOptions, MessageTypeName, Name, NodeName, NodeOptions, QosProfile,
    Subscription, WriteError,
    dds::rustdds::Topic,
    qos::{Durability, History, WhenFull},
};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::ends::{DroneEnd, FusionEnd};
use crate::link::{
    DroneLink, FusionLink, LinkError, Order, Report, TeamKey, UnixTime, View,
    ros::{
        self, FRAME, Kept, Publish, Publisher, RosHeader, Subscribe, Subscriber, Topics,
        drone_name, seconds,
    },
};

/// Name of the link in errors.
const OVER: &str = "ROS 2";

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

/// The fusing end of a link over ROS 2: the drones' topics the other way round, and for viewers
/// each drone's `goal` and `path`, `/foxhunt/beacon_<n>/estimate` and `/diagnostics`.
/// With the key of the team it takes `signed_report` of each drone and sends `signed_order`.
#[derive(Debug)]
pub struct Ros2Fusion(FusionEnd<Header, Node>);

impl Ros2Fusion {
    /// Joins the network as the fusing node, for a number of drones. Without a key nothing is
    /// signed, and every sender is believed.
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

/// `std_msgs/msg/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Header {
    sec: i32,
    nanosec: u32,
    frame_id: String,
}

impl RosHeader for Header {
    fn at(moment: UnixTime) -> Result<Self, LinkError> {
        let sec = seconds("stamp.sec", moment)?;
        Ok(Self { sec, nanosec: moment.nanosec, frame_id: FRAME.to_owned() })
    }

    fn moment(&self) -> UnixTime {
        UnixTime { sec: i64::from(self.sec), nanosec: self.nanosec }
    }
}

/// Settings of a node in the network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Ros2Config {
    /// Number of the network on shared wires: `ROS_DOMAIN_ID`, 0 unless given.
    pub domain_id: u16,
}

/// The type of a message, by its package and its name there.
trait RosMessage: Serialize + DeserializeOwned + Send + 'static {
    const PACKAGE: &'static str;
    const NAME: &'static str;
}

macro_rules! messages {
    ($($package:literal: $($message:ident),+;)+) => {
        $($(impl RosMessage for ros::$message<Header> {
            const PACKAGE: &'static str = $package;
            const NAME: &'static str = stringify!($message);
        })+)+
    };
}

messages! {
    "geometry_msgs": PoseStamped, PoseWithCovarianceStamped;
    "nav_msgs": Path;
    "diagnostic_msgs": DiagnosticArray;
    "foxhunt_msgs": Reception, Order, Status;
}

impl RosMessage for ros::Text {
    const PACKAGE: &'static str = "std_msgs";
    const NAME: &'static str = "String";
}

/// A node that has joined.
struct Node {
    node: ros2_client::Node,
    /// The node lives no longer than this.
    _context: Context,
}

/// A topic that is published on, with its name for errors.
struct Published<M: Serialize>(ros2_client::Publisher<M>, String);

/// A topic that is subscribed to, with its name for errors.
struct Subscribed<M: 'static>(Subscription<M>, String);

/// Reason why something could not be made.
struct Reason(String);

impl<E: std::fmt::Display> From<E> for Reason {
    fn from(error: E) -> Self {
        Self(error.to_string())
    }
}

impl Node {
    /// Joins as a node of this name.
    fn join(config: Ros2Config, name: &str) -> Result<Self, LinkError> {
        let joined = || -> Result<Self, Reason> {
            let context = Context::with_options(ContextOptions::new().domain_id(config.domain_id))?;
            let name = NodeName::new("/foxhunt", name)?;
            let node = context.new_node(name, NodeOptions::new().enable_rosout(false))?;
            Ok(Self { node, _context: context })
        };
        joined().map_err(cannot(&format!("the node {name}")))
    }

    fn topic<M: RosMessage>(&mut self, topic: &str, qos: &QosProfile) -> Result<Topic, Reason> {
        let kind = MessageTypeName::new(M::PACKAGE, M::NAME);
        Ok(self.node.create_topic(&name(topic)?, kind, qos)?)
    }
}

impl<M: RosMessage> Topics<M> for Node {
    fn publisher(&mut self, topic: &str, kept: Kept) -> Result<Publisher<M>, LinkError> {
        let mut make = || -> Result<_, Reason> {
            let made = self.topic::<M>(topic, &quality(kept))?;
            Ok(self.node.create_publisher(&made, None)?)
        };
        Ok(Box::new(Published(make().map_err(cannot(topic))?, topic.to_owned())))
    }

    fn late_publisher(&mut self, topic: &str) -> Result<Publisher<M>, LinkError> {
        // Nothing of DDS waits for the network.
        self.publisher(topic, Kept::Last)
    }

    fn subscriber(&mut self, topic: &str, depth: usize) -> Result<Subscriber<M>, LinkError> {
        let mut make = || -> Result<_, Reason> {
            let made = self.topic::<M>(topic, &quality(Kept::Queue(depth)))?;
            Ok(self.node.create_subscription(&made, None)?)
        };
        Ok(Box::new(Subscribed(make().map_err(cannot(topic))?, topic.to_owned())))
    }
}

impl<M: RosMessage> Publish<M> for Published<M> {
    fn publish(&mut self, message: M) -> Result<(), LinkError> {
        match self.0.publish(message) {
            Ok(()) | Err(WriteError::WouldBlock { .. }) => Ok(()),
            Err(error) => Err(failed(&self.1, error)),
        }
    }
}

impl<M: RosMessage> Subscribe<M> for Subscribed<M> {
    fn take(&mut self) -> Result<Option<M>, LinkError> {
        match self.0.take() {
            Ok(taken) => Ok(taken.map(|(message, _)| message)),
            Err(error) => Err(failed(&self.1, error)),
        }
    }
}

fn cannot(what: &str) -> impl FnOnce(Reason) -> LinkError {
    let what = what.to_owned();
    move |Reason(reason)| LinkError::Open { over: OVER, what, reason }
}

fn name(topic: &str) -> Result<Name, Reason> {
    let (space, base) = topic.rsplit_once('/').unwrap_or(("", topic));
    Ok(Name::new(if space.is_empty() { "/" } else { space }, base)?)
}

fn quality(kept: Kept) -> QosProfile {
    // What does not go out now is repeated.
    let qos = QosProfile::publisher_default().reliability_reliable(WhenFull::Fail);
    match kept {
        Kept::Queue(depth) => {
            qos.durability(Durability::Volatile).history(History::KeepLast { depth })
        }
        Kept::Last => {
            qos.durability(Durability::TransientLocal).history(History::KeepLast { depth: 1 })
        }
    }
}

fn failed(topic: &str, reason: impl std::fmt::Display) -> LinkError {
    LinkError::Message { over: OVER, what: topic.to_owned(), reason: reason.to_string() }
}

#[cfg(test)]
mod tests {
    use ros2_client::dds::rustdds::{
        CDRDeserializerAdapter, CDRSerializerAdapter, RepresentationIdentifier,
        no_key::{DeserializerAdapter, SerializerAdapter},
    };

    use super::*;

    /// The four lists at the end of a reception, empty.
    const TAIL: usize = 4 * size_of::<u32>();

    fn read(bytes: &[u8]) -> Option<ros::Reception<Header>> {
        CDRDeserializerAdapter::from_bytes(bytes, RepresentationIdentifier::CDR_LE).ok()
    }

    #[test]
    fn a_reception_of_an_older_sender_is_read() {
        let sent = ros::Reception::<Header> {
            heard: true,
            rss_dbm: -61.5,
            position_sigma: vec![1.0, 1.0, 2.0],
            ..ros::Reception::default()
        };
        let bytes = CDRSerializerAdapter::<ros::Reception<Header>>::to_bytes(&sent);
        let bytes = bytes.expect("plain data");
        for end in [bytes.len(), bytes.len() - TAIL] {
            let read = read(&bytes[..end]);
            assert_eq!(read.as_ref(), Some(&sent), "{end} of {} bytes", bytes.len());
        }
        assert_eq!(read(&bytes[..bytes.len() - TAIL - 1]), None);
    }
}
