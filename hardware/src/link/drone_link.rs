use super::{LinkError, Order, Report};

/// A drone's end of a link: reports go out, orders come in. Nothing waits; whatever is sent may be
/// lost, late or doubled.
pub trait DroneLink {
    /// Sends a report.
    ///
    /// # Errors
    ///
    /// Whatever the link says; it may be tried again.
    fn send(&mut self, report: &Report) -> Result<(), LinkError>;

    /// The next order that has come; `None` while there is none.
    ///
    /// # Errors
    ///
    /// Whatever the link says; the message is lost, and it may be asked again.
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
