use ros2_client::{
    Context, ContextOptions, MessageTypeName, Name, Node, NodeName, NodeOptions, Publisher,
    QosProfile, Subscription, WriteError,
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

    pub(super) fn speaker<M: Serialize>(
        &mut self,
        topic: &str,
        kind: (&str, &str),
        kept: Kept,
    ) -> Result<Speaker<M>, LinkError> {
        let mut make = || -> Result<_, Reason> {
            let made = self.node.create_topic(&name(topic)?, kind_of(kind), &quality(kept))?;
            Ok(self.node.create_publisher(&made, None)?)
        };
        Ok(Speaker(make().map_err(cannot(topic))?, topic.to_owned()))
    }

    pub(super) fn listener<M: DeserializeOwned + 'static>(
        &mut self,
        topic: &str,
        kind: (&str, &str),
        depth: usize,
    ) -> Result<Listener<M>, LinkError> {
        let mut make = || -> Result<_, Reason> {
            let quality = quality(Kept::Nothing(depth));
            let made = self.node.create_topic(&name(topic)?, kind_of(kind), &quality)?;
            Ok(self.node.create_subscription(&made, None)?)
        };
        Ok(Listener(make().map_err(cannot(topic))?, topic.to_owned()))
    }
}

fn name(topic: &str) -> Result<Name, Reason> {
    let (space, base) = topic.rsplit_once('/').unwrap_or(("", topic));
    Ok(Name::new(if space.is_empty() { "/" } else { space }, base)?)
}

fn kind_of((package, message): (&str, &str)) -> MessageTypeName {
    MessageTypeName::new(package, message)
}

fn quality(kept: Kept) -> QosProfile {
    // What does not go out now is said again.
    let qos = QosProfile::publisher_default().reliability_reliable(WhenFull::Fail);
    match kept {
        Kept::Nothing(depth) => {
            qos.durability(Durability::Volatile).history(History::KeepLast { depth })
        }
        Kept::Last => {
            qos.durability(Durability::TransientLocal).history(History::KeepLast { depth: 1 })
        }
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
