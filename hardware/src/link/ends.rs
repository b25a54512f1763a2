//! The two ends of a link, and their errors.

use std::fmt;

use super::{Order, Report, View};

/// A drone's end of a link: reports go out, orders come in. Nothing waits; whatever is sent may be
/// lost, late or doubled.
///
/// A link over the channels of one program:
///
/// ```
/// use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, TrySendError, sync_channel};
///
/// use foxhunt_hardware::link::{DroneLink, LinkError, Order, Report, Status, UnixTime};
///
/// struct Channels {
///     reports: SyncSender<Report>,
///     orders: Receiver<Order>,
/// }
///
/// fn closed(what: &str) -> LinkError {
///     LinkError::Message { over: "channels", what: what.to_owned(), reason: "closed".to_owned() }
/// }
///
/// impl DroneLink for Channels {
///     fn send(&mut self, report: &Report) -> Result<(), LinkError> {
///         match self.reports.try_send(report.clone()) {
///             // What has no room is lost; reports are repeated.
///             Ok(()) | Err(TrySendError::Full(_)) => Ok(()),
///             Err(TrySendError::Disconnected(_)) => Err(closed("reports")),
///         }
///     }
///
///     fn receive(&mut self) -> Result<Option<Order>, LinkError> {
///         match self.orders.try_recv() {
///             Ok(order) => Ok(Some(order)),
///             Err(TryRecvError::Empty) => Ok(None),
///             Err(TryRecvError::Disconnected) => Err(closed("orders")),
///         }
///     }
/// }
///
/// let (reports, at_fusion) = sync_channel(100);
/// let (orders, at_drone) = sync_channel(10);
/// let mut link = Channels { reports, orders: at_drone };
/// let at = UnixTime::whole(1_800_000_000);
/// link.send(&Report::Status(Status { at, ..Status::default() }))?;
/// assert!(at_fusion.recv().is_ok());
/// assert_eq!(link.receive()?, None);
/// orders.send(Order { number: 1, ..Order::default() }).expect("it is open");
/// assert_eq!(link.receive()?.map(|order| order.number), Some(1));
/// # Ok::<(), LinkError>(())
/// ```
pub trait DroneLink {
    /// Sends a report.
    ///
    /// # Errors
    ///
    /// Any error of the link; the call may be repeated.
    fn send(&mut self, report: &Report) -> Result<(), LinkError>;

    /// Returns the next order that has come, if one has.
    ///
    /// # Errors
    ///
    /// Any error of the link; the message is lost, and the call may be repeated.
    fn receive(&mut self) -> Result<Option<Order>, LinkError>;
}

impl<L: DroneLink + ?Sized> DroneLink for Box<L> {
    fn send(&mut self, report: &Report) -> Result<(), LinkError> {
        (**self).send(report)
    }

    fn receive(&mut self) -> Result<Option<Order>, LinkError> {
        (**self).receive()
    }
}

/// The fusing end of a link: reports of all drones come in, orders go out to each. Nothing waits;
/// whatever is sent may be lost, late or doubled.
///
/// A link that counts the reports of each drone that come over another one:
///
/// ```
/// use foxhunt_hardware::link::{
///     DroneLink, FusionLink, LinkError, Order, Report, Status, UnixTime, View, memory_network,
/// };
///
/// struct Counted<L> {
///     link: L,
///     reports: Vec<u64>,
/// }
///
/// impl<L: FusionLink> FusionLink for Counted<L> {
///     fn send(&mut self, drone: usize, order: &Order) -> Result<(), LinkError> {
///         self.link.send(drone, order)
///     }
///
///     fn receive(&mut self) -> Result<Option<(usize, Report)>, LinkError> {
///         let received = self.link.receive()?;
///         let drone = received.as_ref().map(|(drone, _)| *drone);
///         if let Some(count) = drone.and_then(|drone| self.reports.get_mut(drone)) {
///             *count += 1;
///         }
///         Ok(received)
///     }
///
///     fn show(&mut self, view: &View) -> Result<(), LinkError> {
///         self.link.show(view)
///     }
/// }
///
/// let (mut drones, fusion) = memory_network(2);
/// let mut link = Counted { link: fusion, reports: vec![0; 2] };
/// let at = UnixTime::whole(1_800_000_000);
/// drones[1].send(&Report::Status(Status { at, ..Status::default() }))?;
/// while link.receive()?.is_some() {}
/// assert_eq!(link.reports, [0, 1]);
/// # Ok::<(), LinkError>(())
/// ```
pub trait FusionLink {
    /// Sends an order to a drone, counted from 0.
    ///
    /// # Errors
    ///
    /// Any error of the link; the call may be repeated.
    fn send(&mut self, drone: usize, order: &Order) -> Result<(), LinkError>;

    /// Returns the next report that has come, and the drone that sent it, if one has.
    ///
    /// # Errors
    ///
    /// Any error of the link; the message is lost, and the call may be repeated.
    fn receive(&mut self) -> Result<Option<(usize, Report)>, LinkError>;

    /// Shows the hunt to whoever looks on; nobody, unless overridden.
    ///
    /// # Errors
    ///
    /// Any error of the link.
    fn show(&mut self, view: &View) -> Result<(), LinkError> {
        let _ = view;
        Ok(())
    }
}

impl<L: FusionLink + ?Sized> FusionLink for Box<L> {
    fn send(&mut self, drone: usize, order: &Order) -> Result<(), LinkError> {
        (**self).send(drone, order)
    }

    fn receive(&mut self) -> Result<Option<(usize, Report)>, LinkError> {
        (**self).receive()
    }

    fn show(&mut self, view: &View) -> Result<(), LinkError> {
        (**self).show(view)
    }
}

/// Error of a link that did not carry something.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LinkError {
    /// It could not be set up.
    #[error("{over}: {what} cannot be set up: {reason}")]
    Open {
        /// Name of the layer that failed, such as MQTT.
        over: &'static str,
        /// The part that could not be set up, such as a topic.
        what: String,
        /// The reason given.
        reason: String,
    },
    /// A message could not be sent, or one that came could not be read.
    #[error("{over}: {what}: {reason}")]
    Message {
        /// Name of the layer that failed, such as MQTT.
        over: &'static str,
        /// The topic.
        what: String,
        /// The reason given.
        reason: String,
    },
    /// There is no such drone.
    #[error("there is no drone {drone}; there are {drones}, counted from 0")]
    Drone {
        /// Requested drone.
        drone: usize,
        /// Number of drones.
        drones: usize,
    },
    /// Messages were refused. It is reported for the first of them since the link was set up, the
    /// tenth, the hundredth and so on.
    #[error("{from}: {count} refused: {why}")]
    Refused {
        /// The channel that they came on, such as `drone_0/report`.
        from: String,
        /// Reason.
        why: Refusal,
        /// Number of refusals for this reason.
        count: u64,
    },
    /// A number cannot be sent this way.
    #[error("{field} is {value}, which cannot be sent")]
    Value {
        /// Name of the number.
        field: &'static str,
        /// Value of the number.
        value: String,
    },
}

/// Reason why a message is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Refusal {
    /// It is longer than any message is.
    Oversize,
    /// It is no message of a foxhunt node.
    Garbage,
    /// It is not signed, and this node has a key.
    Unsigned,
    /// It is signed, and this node has no key.
    Signed,
    /// It was signed with another key, or changed on its way.
    WrongKey,
    /// It came before.
    Replayed,
    /// It was sent to an earlier run of this node, or by an earlier run of its sender.
    Stale,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Oversize => "too long for a message",
            Self::Garbage => "no message of a foxhunt node",
            Self::Unsigned => "not signed; every node needs the key of the team",
            Self::Signed => "signed, and this node has no key",
            Self::WrongKey => "not signed with the key of this node",
            Self::Replayed => "came before",
            Self::Stale => "of an earlier run",
        })
    }
}
