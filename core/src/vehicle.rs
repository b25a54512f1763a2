use nalgebra::Vector3;

use crate::{Pose, Waypoint};

/// An aircraft that reports its pose and flies to places.
pub trait Vehicle {
    /// Why the link or the autopilot failed.
    type Error: core::error::Error + 'static;

    /// The aircraft's present pose.
    ///
    /// # Errors
    ///
    /// Any failure of the link.
    fn pose(&mut self) -> Result<Pose, Self::Error>;

    /// How uncertain its place is: σ of East, North and Up in metres, as of the last
    /// [`pose`](Self::pose); `None`, unless overridden, where it does not report that.
    fn position_sigma(&self) -> Option<Vector3<f64>> {
        None
    }

    /// Orders a flight to `goal`; returns when the order is accepted, not on arrival.
    ///
    /// # Errors
    ///
    /// Any failure of the link, or the autopilot's refusal.
    fn go_to(&mut self, goal: &Waypoint) -> Result<(), Self::Error>;

    /// Lands it where it is; returns when the order is accepted. Unless overridden, it is sent to
    /// the ground below, an Up of 0.
    ///
    /// # Errors
    ///
    /// Any failure of the link, or the autopilot's refusal.
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

/// An aircraft that can turn about its vertical axis for as long as it is ordered to, while it
/// hovers and while it flies.
pub trait Spinner: Vehicle {
    /// Turns at `rate` radians per second, counter-clockwise from above where it is positive,
    /// until the next order; `None` holds the heading. Returns when the order is accepted.
    /// Where it flies to is another matter.
    ///
    /// # Errors
    ///
    /// Any failure of the link, or the autopilot's refusal.
    fn spin(&mut self, rate: Option<f64>) -> Result<(), Self::Error>;
}
