use ros2_client::{
    Context, ContextOptions, MessageTypeName, Name, Node, NodeName, NodeOptions, Publisher,
    QosProfile, Subscription, Topic, WriteError,
    qos::{Durability, History, WhenFull},
};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::link::LinkError;

/// What errors call it.
const OVER: &str = "ROS 2";

/// How a node joins the network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Ros2Config {
    /// The network among those that share the wires: `ROS_DOMAIN_ID`, 0 unless given.
    pub domain_id: u16,
}

/// What is kept for those who come late.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kept {
    /// Nothing; so many messages for those who are slow.
    Nothing(usize),
    /// The last message.
    Last,
}

/// A node that has joined.
pub(super) struct Opened {
    node: Node,
    /// The node lives no longer than this.
    _context: Context,
}

/// A topic that is spoken on, with its name for errors.
pub(super) struct Speaker<M: Serialize>(Publisher<M>, String);

/// A topic that is listened to, with its name for errors.
pub(super) struct Listener<M: 'static>(Subscription<M>, String);

fn cannot(what: &str) -> impl FnOnce(Reason) -> LinkError {
    let what = what.to_owned();
    move |Reason(reason)| LinkError::Open { over: OVER, what, reason }
}

/// Whatever was said.
struct Reason(String);

impl<E: std::fmt::Display> From<E> for Reason {
    fn from(error: E) -> Self {
        Self(error.to_string())
    }
}

impl Opened {
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

    fn topic(&mut self, topic: &str, kind: (&str, &str), kept: Kept) -> Result<Topic, Reason> {
        let (space, base) = topic.rsplit_once('/').unwrap_or(("", topic));
        let space = if space.is_empty() { "/" } else { space };
        let qos = QosProfile::publisher_default()
            // What does not go out now is said again.
            .reliability_reliable(WhenFull::Fail);
        let qos = match kept {
            Kept::Nothing(depth) => {
                qos.durability(Durability::Volatile).history(History::KeepLast { depth })
            }
            Kept::Last => {
                qos.durability(Durability::TransientLocal).history(History::KeepLast { depth: 1 })
            }
        };
        let kind = MessageTypeName::new(kind.0, kind.1);
        Ok(self.node.create_topic(&Name::new(space, base)?, kind, &qos)?)
    }

    pub(super) fn speaker<M: Serialize>(
        &mut self,
        topic: &str,
        kind: (&str, &str),
        kept: Kept,
    ) -> Result<Speaker<M>, LinkError> {
        let made = self
            .topic(topic, kind, kept)
            .and_then(|made| Ok(self.node.create_publisher(&made, None)?))
            .map_err(cannot(topic))?;
        Ok(Speaker(made, topic.to_owned()))
    }

    pub(super) fn listener<M: DeserializeOwned + 'static>(
        &mut self,
        topic: &str,
        kind: (&str, &str),
        depth: usize,
    ) -> Result<Listener<M>, LinkError> {
        let made = self
            .topic(topic, kind, Kept::Nothing(depth))
            .and_then(|made| Ok(self.node.create_subscription(&made, None)?))
            .map_err(cannot(topic))?;
        Ok(Listener(made, topic.to_owned()))
    }
}

impl<M: Serialize> Speaker<M> {
    pub(super) fn say(&self, message: M) -> Result<(), LinkError> {
        match self.0.publish(message) {
            Ok(()) | Err(WriteError::WouldBlock { .. }) => Ok(()),
            Err(error) => {
                let (what, reason) = (self.1.clone(), error.to_string());
                Err(LinkError::Message { over: OVER, what, reason })
            }
        }
    }
}

impl<M: DeserializeOwned + 'static> Listener<M> {
    pub(super) fn hear(&self) -> Result<Option<M>, LinkError> {
        match self.0.take() {
            Ok(taken) => Ok(taken.map(|(message, _)| message)),
            Err(error) => {
                let (what, reason) = (self.1.clone(), error.to_string());
                Err(LinkError::Message { over: OVER, what, reason })
            }
        }
    }
}
