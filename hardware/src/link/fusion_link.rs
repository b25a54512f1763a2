use super::{LinkError, Order, Report, View};

/// The end of a link of the one that fuses: reports of all drones come in, orders go out to each.
/// Nothing waits; whatever is sent may be lost, late or doubled.
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
///         if let Some(count) = received.as_ref().and_then(|(drone, _)| self.reports.get_mut(*drone)) {
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
