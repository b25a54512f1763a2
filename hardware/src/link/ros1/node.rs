use std::{
    pin::pin,
    task::{Context, Poll, Waker},
    time::Duration,
};

use roslibrust::{
    RosMessageType,
    ros1::{NodeError, NodeHandle},
};
use serde::{Deserialize, Serialize};
use tokio::{
    runtime::{Builder, Runtime},
    task::JoinHandle,
};

use crate::link::{
    LinkError,
    ros::{Kept, Publish, Publisher, Subscribe, Subscriber, Topics},
};

/// Name of the link in errors.
const OVER: &str = "ROS 1";

/// Most messages that are kept for subscribers that are slow.
const QUEUE: usize = 100;

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
pub(super) struct Node {
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

fn open(what: &str, reason: impl std::fmt::Display) -> LinkError {
    LinkError::Open { over: OVER, what: what.to_owned(), reason: reason.to_string() }
}

impl Node {
    /// Joins as a node of this name; waits for the master's answer.
    pub(super) fn join(config: &Ros1Config, name: &str) -> Result<Self, LinkError> {
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
