use super::{LinkError, Order, Report, View};

/// The end of a link of the one that fuses: reports of all drones come in, orders go out to each.
/// Nothing waits; whatever is sent may be lost, late or doubled.
pub trait FusionLink {
    /// Sends an order to a drone, counted from 0.
    ///
    /// # Errors
    ///
    /// Whatever the link says; it may be tried again.
    fn send(&mut self, drone: usize, order: &Order) -> Result<(), LinkError>;

    /// The next report that has come, and of which drone; `None` while there is none.
    ///
    /// # Errors
    ///
    /// Whatever the link says; the message is lost, and it may be asked again.
    fn receive(&mut self) -> Result<Option<(usize, Report)>, LinkError>;

    /// Shows the hunt to whoever looks on; nobody, unless overridden.
    ///
    /// # Errors
    ///
    /// Whatever the link says.
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
