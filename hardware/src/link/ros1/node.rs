use std::{
    pin::pin,
    task::{Context, Poll, Waker},
    time::Duration,
};

use roslibrust::{
    RosMessageType,
    ros1::{NodeError, NodeHandle, Publisher, Subscriber},
};
use serde::{Deserialize, Serialize};
use tokio::{
    runtime::{Builder, Runtime},
    task::JoinHandle,
};

use crate::link::LinkError;

/// What errors call it.
const OVER: &str = "ROS 1";

/// How many messages are kept for those who are slow.
const QUEUE: usize = 100;

/// How a node joins the network. Its own name in it comes from `ROS_HOSTNAME` or `ROS_IP`, as for every
/// node of ROS 1.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Ros1Config {
    /// Where the master is, as in `ROS_MASTER_URI`.
    pub master_uri: String,
}

impl Default for Ros1Config {
    /// A master on this machine.
    fn default() -> Self {
        Self { master_uri: "http://localhost:11311".to_owned() }
    }
}

/// A node that has joined. What serves it runs on a thread of its own, which ends with it.
pub(super) struct Joined {
    // Before the runtime that it needs for its farewell to the master.
    node: Option<NodeHandle>,
    runtime: Option<Runtime>,
}

/// A topic that is spoken on, with its name for errors.
pub(super) struct Speaker<M>(Publisher<M>, String);

/// A topic that is to be spoken on as soon as the master has answered, with its name for errors.
pub(super) enum Announced<M> {
    Asked(JoinHandle<Result<Publisher<M>, NodeError>>, String),
    Open(Speaker<M>),
}

/// A topic that is listened to, with its name for errors.
pub(super) struct Listener<M>(Subscriber<M>, String);

fn open(what: &str, reason: impl std::fmt::Display) -> LinkError {
    LinkError::Open { over: OVER, what: what.to_owned(), reason: reason.to_string() }
}

impl Joined {
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

    /// Announces a topic; `latched` is kept for those who come late.
    pub(super) fn speaker<M: RosMessageType>(
        &self,
        topic: &str,
        latched: bool,
    ) -> Result<Speaker<M>, LinkError> {
        let (node, runtime) = self.parts()?;
        let made = runtime.block_on(node.advertise::<M>(topic, QUEUE, latched));
        Ok(Speaker(made.map_err(|error| open(topic, error))?, topic.to_owned()))
    }

    /// Announces a topic, latched, without waiting for the master: that would hold up the one who asks.
    pub(super) fn announce<M: RosMessageType>(
        &self,
        topic: &str,
    ) -> Result<Announced<M>, LinkError> {
        let (node, runtime) = self.parts()?;
        let (node, name) = (node.clone(), topic.to_owned());
        let asked = runtime.spawn(async move { node.advertise::<M>(&name, QUEUE, true).await });
        Ok(Announced::Asked(asked, topic.to_owned()))
    }

    pub(super) fn listener<M: RosMessageType>(
        &self,
        topic: &str,
    ) -> Result<Listener<M>, LinkError> {
        let (node, runtime) = self.parts()?;
        let made = runtime.block_on(node.subscribe::<M>(topic, QUEUE));
        Ok(Listener(made.map_err(|error| open(topic, error))?, topic.to_owned()))
    }
}

impl Drop for Joined {
    fn drop(&mut self) {
        self.node = None;
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_timeout(Duration::from_millis(500));
        }
    }
}

/// What a future has by now; nothing is waited for.
fn now<F: Future>(future: F) -> Option<F::Output> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(output) => Some(output),
        Poll::Pending => None,
    }
}

fn failed(topic: &str, reason: impl std::fmt::Display) -> LinkError {
    LinkError::Message { over: OVER, what: topic.to_owned(), reason: reason.to_string() }
}

impl<M: RosMessageType> Announced<M> {
    /// Says it if the master has answered. After an error it has to be announced anew.
    pub(super) fn say(&mut self, message: &M) -> Result<(), LinkError> {
        if let Self::Asked(asked, topic) = self
            && let Some(answer) = now(asked)
        {
            let made = answer.map_err(|error| open(topic, error))?;
            let made = made.map_err(|error| open(topic, error))?;
            *self = Self::Open(Speaker(made, std::mem::take(topic)));
        }
        match self {
            Self::Asked(..) => Ok(()),
            Self::Open(speaker) => speaker.say(message),
        }
    }
}

impl<M: RosMessageType> Speaker<M> {
    pub(super) fn say(&self, message: &M) -> Result<(), LinkError> {
        // It is put into a queue, or nobody listens.
        now(self.0.publish(message)).map_or(Ok(()), |said| said.map_err(|e| failed(&self.1, e)))
    }
}

impl<M: RosMessageType> Listener<M> {
    pub(super) fn hear(&mut self) -> Result<Option<M>, LinkError> {
        match now(self.0.next()) {
            None => Ok(None),
            Some(Some(Ok(message))) => Ok(Some(message)),
            // Among them: some were lost because nobody asked, and will be said again.
            Some(Some(Err(error))) => Err(failed(&self.1, error)),
            Some(None) => Err(failed(&self.1, "the node has left")),
        }
    }
}
