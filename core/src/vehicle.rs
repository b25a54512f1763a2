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

/// All aircraft of a hunt, counted from 0. A slice of vehicles is one; so is a simulated world.
///
/// Every aircraft is asked and sent by itself, so that one that fails does not keep the others.
pub trait Fleet {
    /// Why an aircraft did not do it.
    type Error: core::error::Error + 'static;

    /// Where an aircraft is now.
    ///
    /// # Errors
    ///
    /// Whatever its link says, or that there is no such aircraft.
    fn locate(&mut self, drone: usize) -> Result<Pose, Self::Error>;

    /// Sends an aircraft somewhere; returns when the order is accepted.
    ///
    /// # Errors
    ///
    /// Whatever its link or autopilot says, or that there is no such aircraft.
    fn send(&mut self, drone: usize, goal: &Waypoint) -> Result<(), Self::Error>;

    /// Lands an aircraft where it is; returns when the order is accepted.
    ///
    /// # Errors
    ///
    /// Whatever its link or autopilot says, or that there is no such aircraft.
    fn land(&mut self, drone: usize) -> Result<(), Self::Error>;
}

/// Why an aircraft of several did not do what it was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FleetError<E> {
    /// There is no such aircraft.
    #[error("there is no drone {drone}; there are {drones}, counted from 0")]
    Drone {
        /// Which one was asked for.
        drone: usize,
        /// How many there are.
        drones: usize,
    },
    /// The aircraft said so.
    #[error(transparent)]
    Vehicle(#[from] E),
}

impl<V: Vehicle> Fleet for [V] {
    type Error = FleetError<V::Error>;

    fn locate(&mut self, drone: usize) -> Result<Pose, Self::Error> {
        Ok(nth(self, drone)?.pose()?)
    }

    fn send(&mut self, drone: usize, goal: &Waypoint) -> Result<(), Self::Error> {
        Ok(nth(self, drone)?.go_to(goal)?)
    }

    fn land(&mut self, drone: usize) -> Result<(), Self::Error> {
        Ok(nth(self, drone)?.land()?)
    }
}

fn nth<V: Vehicle>(vehicles: &mut [V], drone: usize) -> Result<&mut V, FleetError<V::Error>> {
    let drones = vehicles.len();
    vehicles.get_mut(drone).ok_or(FleetError::Drone { drone, drones })
}
