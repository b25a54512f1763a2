use crate::link::LinkError;

/// Messages that are kept: for subscribers that are slow, or for those that come late.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::link) enum Kept {
    /// A queue of this length for subscribers that are slow; those that come late get nothing.
    Queue(usize),
    /// The last one, for subscribers that come late.
    Last,
}

/// A topic that messages are published on.
pub(in crate::link) trait Publish<M> {
    /// Publishes a message; nothing is waited for.
    fn publish(&mut self, message: M) -> Result<(), LinkError>;
}

/// A topic that messages come by.
pub(in crate::link) trait Subscribe<M> {
    /// The next message that has come.
    fn take(&mut self) -> Result<Option<M>, LinkError>;
}

/// A publisher of either version of ROS.
pub(in crate::link) type Publisher<M> = Box<dyn Publish<M> + Send>;

/// A subscriber of either version of ROS.
pub(in crate::link) type Subscriber<M> = Box<dyn Subscribe<M> + Send>;

/// A node of the network that makes topics of messages `M`.
pub(in crate::link) trait Topics<M> {
    /// A topic to publish on.
    fn publisher(&mut self, topic: &str, kept: Kept) -> Result<Publisher<M>, LinkError>;

    /// A topic to publish on whose last message is kept. It does not wait for the network: what is
    /// published before the network knows of the topic is lost, and after a [`LinkError::Open`] it
    /// has to be made again.
    fn late_publisher(&mut self, topic: &str) -> Result<Publisher<M>, LinkError>;

    /// A topic to subscribe to, with a queue of `depth` messages.
    fn subscriber(&mut self, topic: &str, depth: usize) -> Result<Subscriber<M>, LinkError>;
}
