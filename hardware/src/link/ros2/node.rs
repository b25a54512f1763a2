use ros2_client::{
    Context, ContextOptions, MessageTypeName, Name, NodeName, NodeOptions, QosProfile,
    Subscription, WriteError,
    dds::rustdds::Topic,
    qos::{Durability, History, WhenFull},
};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::Header;
use crate::link::{
    LinkError,
    ros::{self, Kept, Publish, Publisher, Subscribe, Subscriber, Topics},
};

/// Name of the link in errors.
const OVER: &str = "ROS 2";

/// Settings of a node in the network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Ros2Config {
    /// The network among those that share the wires: `ROS_DOMAIN_ID`, 0 unless given.
    pub domain_id: u16,
}

/// The type of a message, by its package and its name there.
pub(super) trait RosMessage: Serialize + DeserializeOwned + Send + 'static {
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
pub(super) struct Node {
    node: ros2_client::Node,
    /// The node lives no longer than this.
    _context: Context,
}

/// A topic that is published on, with its name for errors.
struct Published<M: Serialize>(ros2_client::Publisher<M>, String);

/// A topic that is subscribed to, with its name for errors.
struct Subscribed<M: 'static>(Subscription<M>, String);

fn cannot(what: &str) -> impl FnOnce(Reason) -> LinkError {
    let what = what.to_owned();
    move |Reason(reason)| LinkError::Open { over: OVER, what, reason }
}

/// Reason why something could not be made.
struct Reason(String);

impl<E: std::fmt::Display> From<E> for Reason {
    fn from(error: E) -> Self {
        Self(error.to_string())
    }
}

impl Node {
    /// Joins as a node of this name.
    pub(super) fn join(config: Ros2Config, name: &str) -> Result<Self, LinkError> {
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

fn failed(topic: &str, reason: impl std::fmt::Display) -> LinkError {
    LinkError::Message { over: OVER, what: topic.to_owned(), reason: reason.to_string() }
}
