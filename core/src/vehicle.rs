use nalgebra::Vector3;

use crate::{Pose, Waypoint};

/// An aircraft's motion until something happens: straight, at constant speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteadyMotion {
    /// East, North and Up in metres per second; zero for one that stays where it is.
    pub velocity: Vector3<f64>,
    /// Time until which that holds, in seconds of its clock.
    pub until: f64,
}

/// An aircraft that reports its pose and flies to places.
pub trait Vehicle {
    /// Failure of the link or the autopilot.
    type Error: core::error::Error + 'static;

    /// The aircraft's present pose.
    ///
    /// # Errors
    ///
    /// Any failure of the link.
    fn pose(&mut self) -> Result<Pose, Self::Error>;

    /// σ of its place to East, North and Up in metres, as of the last [`pose`](Self::pose); `None`,
    /// unless overridden, where it does not report that.
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

    /// Motion of its [`pose`](Self::pose), and the time until which it neither changes otherwise
    /// nor fails, unless it is given an order: a simulated aircraft may know. `None`, unless
    /// overridden, where that is not known.
    ///
    /// A simulation goes from one event to the next and leaves out the looks in between.
    fn steady_motion(&self) -> Option<SteadyMotion> {
        None
    }
}

/// An aircraft that can turn about its vertical axis for as long as it is ordered to, while it
/// hovers and while it flies.
pub trait Spinner: Vehicle {
    /// Turns at `rate` radians per second, counter-clockwise from above where it is positive, until
    /// the next order; `None` holds the heading. Returns when the order is accepted. The place that
    /// it flies to is another matter.
    ///
    /// # Errors
    ///
    /// Any failure of the link, or the autopilot's refusal.
    fn spin(&mut self, rate: Option<f64>) -> Result<(), Self::Error>;
}
