use nalgebra::Vector3;

use crate::{Pose, Waypoint};

/// One aircraft.
pub trait Vehicle {
    /// Why the link or the autopilot failed.
    type Error: core::error::Error + 'static;

    /// Where it is now.
    ///
    /// # Errors
    ///
    /// Whatever the link says.
    fn pose(&mut self) -> Result<Pose, Self::Error>;

    /// How uncertain its place is: σ of East, North and Up in metres, as of the last
    /// [`pose`](Self::pose); `None`, unless overridden, where it does not say.
    fn position_sigma(&self) -> Option<Vector3<f64>> {
        None
    }

    /// Sends it somewhere; returns when the order is accepted, not when it is there.
    ///
    /// # Errors
    ///
    /// Whatever the link or the autopilot says.
    fn go_to(&mut self, goal: &Waypoint) -> Result<(), Self::Error>;

    /// Lands it where it is; returns when the order is accepted. Unless overridden, it is sent to
    /// the ground below, an Up of 0.
    ///
    /// # Errors
    ///
    /// Whatever the link or the autopilot says.
    fn land(&mut self) -> Result<(), Self::Error> {
        let mut position = self.pose()?.position;
        position.z = 0.0;
        self.go_to(&Waypoint { position })
    }

    /// The next time at which its [`pose`](Self::pose) may change or fail, in seconds of its clock,
    /// unless it is given an order; infinite where it stays as it is. `None`, unless overridden,
    /// where that is not known, as while it moves.
    fn next_event(&self) -> Option<f64> {
        None
    }
}

/// An aircraft that can turn about its vertical axis for as long as it is asked to, while it hovers
/// and while it flies.
pub trait Spinner: Vehicle {
    /// Turns at `rate` radians per second, counter-clockwise seen from above where it is positive,
    /// until it is told otherwise; `None` holds the heading. Returns when the order is accepted.
    /// Where it flies to is another matter.
    ///
    /// # Errors
    ///
    /// Whatever the link or the autopilot says.
    fn spin(&mut self, rate: Option<f64>) -> Result<(), Self::Error>;
}
