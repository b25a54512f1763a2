use crate::{Pose, Station, Waypoint};

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

    /// Sends it somewhere; returns when the order is accepted, not when it is there.
    ///
    /// # Errors
    ///
    /// Whatever the link or the autopilot says.
    fn go_to(&mut self, goal: &Waypoint) -> Result<(), Self::Error>;
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

/// All aircraft of a hunt. A slice of vehicles is one; so is a simulated world.
///
/// A hunt goes on without the aircraft that fail, so both methods serve every aircraft they can
/// before they tell of the first that failed.
pub trait Fleet {
    /// Why the fleet failed.
    type Error: core::error::Error + 'static;

    /// Fills in where each aircraft is; the pose of one that does not answer stays as it was.
    ///
    /// # Errors
    ///
    /// The first aircraft's error, after the others were served.
    fn locate(&mut self, stations: &mut [Station]) -> Result<(), Self::Error>;

    /// Sends each aircraft to its goal.
    ///
    /// # Errors
    ///
    /// The first aircraft's error, after the others were served.
    fn command(&mut self, stations: &[Station]) -> Result<(), Self::Error>;
}

impl<V: Vehicle> Fleet for [V] {
    type Error = V::Error;

    fn locate(&mut self, stations: &mut [Station]) -> Result<(), V::Error> {
        let mut outcome = Ok(());
        for (vehicle, station) in self.iter_mut().zip(stations) {
            match vehicle.pose() {
                Ok(pose) => station.pose = pose,
                Err(error) => outcome = outcome.and(Err(error)),
            }
        }
        outcome
    }

    fn command(&mut self, stations: &[Station]) -> Result<(), V::Error> {
        let mut outcome = Ok(());
        for (vehicle, station) in self.iter_mut().zip(stations) {
            outcome = outcome.and(vehicle.go_to(&station.goal));
        }
        outcome
    }
}
