use super::{LinkError, Order, Report};

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
